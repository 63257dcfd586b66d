"""The claims of `uavrt experiment detection`, in a reduced seeded form."""

import math

import numpy as np
import pytest

from uavrt.experiments.detection.interference import carrier, impulses
from uavrt.experiments.detection.run import (
    accuracy_rows,
    detection_curve,
    false_alarms,
    follow,
    neighbour,
)
from uavrt.experiments.detection.signals import noise
from uavrt.experiments.detection.theory import (
    ENR_HALF_DB,
    ORIGINAL_PD,
    detection_probability,
    erlang_tail,
    erlang_threshold,
    genie,
    union_bound,
)


def test_single_decisions_are_at_least_as_good_as_the_originals() -> None:
    rows = detection_curve(trials=40, seed=1, enr_db=(8.0, 9.0, 10.0, 12.0))
    for row, level in zip(rows, (8, 9, 10, 12), strict=True):
        assert row.high >= ORIGINAL_PD[level] + 0.02
    total = sum(row.figure for row in rows)
    assert total > sum(ORIGINAL_PD[level] for level in (8, 9, 10, 12)) + 0.2


def test_false_alarms_come_as_often_as_asked_for() -> None:
    row = false_alarms(seconds=1500.0, seed=5, probability=0.2, case="white noise")
    assert 0.5 < row.figure < 1.5


@pytest.mark.parametrize("kind", ["carrier", "drifting carrier", "impulses", "long impulses"])
def test_interference_alone_makes_no_more_false_alarms_than_noise(kind: str) -> None:
    def make(rng: np.random.Generator, count: int) -> np.ndarray:
        samples = noise(rng, count)
        if kind == "carrier":
            return samples + carrier(rng, count, offset_hz=50.0, level_db=30.0)
        if kind == "drifting carrier":
            return samples + carrier(
                rng, count, offset_hz=-300.0, level_db=40.0, drift_hz_per_s=2.0
            )
        if kind == "long impulses":
            return samples + impulses(rng, count, per_s=5.0, level_db=40.0, length_s=5e-3)
        return samples + impulses(rng, count, per_s=1.0, level_db=40.0)

    row = false_alarms(seconds=300.0, seed=6, probability=0.05, case=kind, make=make)
    quiet = false_alarms(seconds=300.0, seed=6, probability=0.05, case="noise")
    assert row.figure <= 2.0 * quiet.figure + 1.0


def test_a_weak_tag_is_followed_without_false_pulses() -> None:
    result = follow(flights=2, seed=7, enr_db=10.0, duration_s=120.0, frequency_window_hz=500.0)
    assert result.confirmed / result.true >= 0.90
    assert result.false_confirmed <= 1


def test_times_frequencies_and_levels_are_accurate() -> None:
    result = follow(flights=2, seed=8, enr_db=20.0, duration_s=100.0, frequency_window_hz=500.0)
    time_rms, frequency_rms, bias = accuracy_rows(result, 20.0)
    assert time_rms.figure <= 1.0
    assert frequency_rms.figure <= 2.5
    assert abs(bias.figure) <= 0.5


@pytest.mark.parametrize(
    "case", ["carrier 100 Hz away", "stronger neighbour", "frequent impulses"]
)
def test_a_tag_is_heard_beside_interference(case: str) -> None:
    extra = {
        "carrier 100 Hz away": lambda r, n: carrier(r, n, offset_hz=233.0, level_db=40.0),
        "stronger neighbour": neighbour(apart_hz=500.0, level_db=24.0),
        "frequent impulses": lambda r, n: impulses(r, n, per_s=5.0, level_db=30.0),
    }[case]
    result = follow(flights=1, seed=9, enr_db=14.0, duration_s=80.0, extra=extra)
    assert result.matched / result.true >= 0.9
    assert result.false_confirmed == 0


def test_theory_agrees_with_the_table_of_the_reference() -> None:
    for k, level in ENR_HALF_DB.items():
        assert abs(union_bound(k, level) - 0.5) < 0.12
    assert genie(3, 2.9) == pytest.approx(0.5, abs=0.03)
    assert erlang_tail(1, 3.0) == pytest.approx(math.exp(-3.0))
    assert erlang_tail(3, erlang_threshold(3, 1e-6)) == pytest.approx(1e-6, rel=1e-6)
    assert detection_probability(1, -60.0, 2.0) == pytest.approx(math.exp(-2.0), rel=1e-3)
