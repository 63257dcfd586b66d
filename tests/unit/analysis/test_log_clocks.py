"""A mast, a person or a drone whose clock is off does not join the others without a word."""

from pathlib import Path

import numpy as np
import pytest

from uavrt.analysis.inputs.log_clocks import clock_doubts, pulse_doubts

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


def train(
    start_ns: int,
    *,
    off_ns: int = 0,
    length_s: float = 900.0,
    seed: int = 0,
    found: float = 0.8,
) -> list[int]:
    """A tag's pulses in a log whose clock is off; a fifth is not heard, some are noise."""
    rng = np.random.default_rng(seed)
    beats = MAY_NS + (np.arange(100_000) * 1.2e9).astype(np.int64)  # a day and more
    heard = beats[(beats >= start_ns) & (beats < start_ns + length_s * 1e9)]
    heard = heard[rng.random(len(heard)) < found]
    noise = start_ns + (1e9 * length_s * rng.random(len(heard) // 50)).astype(np.int64)
    jitter = rng.normal(0.0, 2e6, len(heard)).astype(np.int64)
    return [int(one) for one in np.concatenate([heard + jitter, noise]) + off_ns]


@pytest.mark.parametrize("off_ns", [HOUR_NS + 10**8, -HOUR_NS // 2 + 4 * 10**8, 3 * 10**8])
def test_a_wrong_clock_is_named_also_where_the_logs_overlap(off_ns: int) -> None:
    drone = {8: train(MAY_NS + 3 * HOUR_NS), 9: []}
    mast = {8: train(MAY_NS, off_ns=off_ns, length_s=8 * 3600.0, seed=1)}
    assert pulse_doubts([(Path("drone.jsonl"), drone), (Path("mast.jsonl"), mast)]) == [
        "drone.jsonl and mast.jsonl contain the same tag's pulses at different times: one of "
        "their clocks is wrong, by 0.1 s or much more"
    ]


def test_logs_whose_pulses_agree_or_cannot_be_compared_raise_no_doubt() -> None:
    drone = Path("drone.jsonl"), {8: train(MAY_NS + 3 * HOUR_NS)}
    whole_s = [one // 10**9 * 10**9 for one in train(MAY_NS, length_s=8 * 3600.0, seed=1)]
    noise = np.random.default_rng(1).integers(0, 8 * 3600 * 10**9, 20_000) + MAY_NS
    for times in (
        train(MAY_NS, length_s=8 * 3600.0, seed=1),
        train(MAY_NS, off_ns=5 * 10**7, length_s=8 * 3600.0, seed=1),
        train(MAY_NS, off_ns=HOUR_NS + 10**8, length_s=3600.0, seed=1),  # at other times
        train(MAY_NS + 3 * HOUR_NS, off_ns=4 * 10**8, length_s=20.0),  # too few
        whole_s,
        [int(one) for one in noise],
        [],
    ):
        assert pulse_doubts([drone, (Path("mast.jsonl"), {8: times})]) == []
    other_tag = {9: train(MAY_NS, off_ns=HOUR_NS + 10**8, length_s=8 * 3600.0)}
    assert pulse_doubts([drone, (Path("mast.jsonl"), other_tag)]) == []
