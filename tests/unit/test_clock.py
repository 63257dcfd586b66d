from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.clock import Clock, iso_utc, parse_iso_utc, wall_ns


def test_the_clock_counts_utc_nanoseconds() -> None:
    clock = Clock.start()
    assert clock.now_ns() == wall_ns()


def test_two_readings_never_go_backwards() -> None:
    clock = Clock.start()
    readings = [clock.now_ns() for _ in range(100)]
    assert readings == sorted(readings)


@given(st.integers(0, 4_000_000_000_000_000).map(lambda us: us * 1000))
def test_iso_text_survives_a_round_trip(time_ns: int) -> None:
    assert parse_iso_utc(iso_utc(time_ns)) == time_ns
