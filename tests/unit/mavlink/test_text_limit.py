"""Operators get the texts that matter, and the link stays free."""

from uavrt.link.mavlink.sending.statustext import TextLimiter

SECOND = 1_000_000_000


def test_a_text_that_repeats_is_told_once_in_ten_seconds() -> None:
    limiter = TextLimiter()
    told = [limiter.allows(4, "link lost", n * SECOND) for n in range(21)]
    assert [n for n, allowed in enumerate(told) if allowed] == [0, 10, 20]
    assert limiter.left_out == 18


def test_a_flood_is_thinned_to_one_in_two_seconds_after_the_first_ten() -> None:
    limiter = TextLimiter()
    told = sum(limiter.allows(4, f"text {n}", n * SECOND // 10) for n in range(1000))
    assert 59 <= told <= 60
    assert limiter.left_out == 1000 - told


def test_what_is_critical_always_goes() -> None:
    limiter = TextLimiter()
    assert all(limiter.allows(2, f"critical {n}", 0) for n in range(100))
