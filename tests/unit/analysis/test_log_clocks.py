"""A mast, a person or a drone whose clock is off does not join the others without a word."""

from pathlib import Path

import pytest

from uavrt.analysis.log_clocks import clock_doubts

MAY_NS, HOUR_NS = 1_777_615_200 * 10**9, 3600 * 10**9


def log(start_ns: int) -> list[int]:
    return [start_ns + 10**9 * each for each in range(600)]


def doubts(off_ns: int) -> list[str]:
    drone, mast = Path("drone.jsonl"), Path("mast.jsonl")
    return clock_doubts([(drone, log(MAY_NS)), (mast, log(MAY_NS + off_ns))])


@pytest.mark.parametrize("off_ns", [0, 300 * 10**9, -HOUR_NS // 3])
def test_logs_of_the_same_time_raise_no_doubt(off_ns: int) -> None:
    assert doubts(off_ns) == []


@pytest.mark.parametrize(
    ("off_ns", "says"), [(HOUR_NS, "0:50:0"), (365 * 24 * HOUR_NS, "364 days, 23:50:0")]
)
def test_a_clock_an_hour_or_a_year_off_is_named(off_ns: int, says: str) -> None:
    drone, mast = doubts(off_ns)
    assert drone.startswith("drone.jsonl begins 2026-05-01T06:00")
    assert mast.startswith("mast.jsonl begins")
    assert all(says in text and "a clock is wrong" in text for text in (drone, mast))


def test_a_clock_that_was_never_set_is_named() -> None:
    mast = doubts(-MAY_NS)[-1]
    assert mast == (
        "the clock of mast.jsonl was not set (1970-01-01): its times cannot be compared with "
        "those of the others"
    )


def test_one_log_alone_raises_no_doubt() -> None:
    assert clock_doubts([(Path("mast.jsonl"), log(0))]) == []
