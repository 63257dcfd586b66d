"""The bars of bearings and positions, with few runs: none is contradicted.

With all runs: `uavrt_experiments.localization.experiments.run()`.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from depth import count

from uavrt.core.errors import UsageError
from uavrt_experiments.commands.localization import localization
from uavrt_experiments.figures import measured, median
from uavrt_experiments.localization.experiments import EXPERIMENTS
from uavrt_experiments.localization.moving_bars import moving_tags
from uavrt_experiments.localization.posterior_calibration import (
    FAULTS,
    LEAST_P,
    RANKS,
    p_uniform,
)
from uavrt_experiments.localization.rotations import RotationCase, bound_deg
from uavrt_experiments.result import Row
from uavrt_experiments.tables import drawn

pytestmark = pytest.mark.slow

RUNS = {
    "B1, B2": 6,
    "B3, B4": 3,
    "B5": 10,
    "B6": 6,
    "A1": 30,
    "L2, L3": 15,
    "L4": 4,
    "L5": 40,
    "L6": count(1, 3),
    "L7": count(1, 3),
    "L8": count(1, 20),
    "M1": count(1, 20),
}


@pytest.mark.parametrize("name", RUNS)
def test_no_bar_is_contradicted(name: str) -> None:
    """One outside twice the 95 % interval of what was measured would be."""
    results = EXPERIMENTS[name](RUNS[name], 11)
    contradicted = [
        one
        for one in results
        if (one.most is not None and 2 * one.low - one.figure > one.most)
        or (one.least is not None and 2 * one.high - one.figure < one.least)
    ]
    assert not contradicted, drawn(contradicted)
    assert any(one.barred for one in results)


@pytest.mark.parametrize(
    ("kind", "walks"), [("survey, out of its area", 4), ("six turns, stop and go", 8)]
)
def test_circles_along_a_path_hold_the_animal(kind: str, walks: int) -> None:
    """Of the circles of animals that left the area, 85 % held when one tracker was trusted."""
    rows = moving_tags(count(walks, 5 * walks), 11, only=kind)
    assert not [one for one in rows if one.contradicted], drawn(rows)


@pytest.mark.parametrize("name", RANKS)
def test_ranks_of_truths_in_posteriors_are_uniform(name: str) -> None:
    draws = FEWER_RANKS.get(name, 60)
    assert p_uniform(RANKS[name], count(draws, 400), 21) > LEAST_P / len(RANKS)


FEWER_DRAWS = {
    "positions 20 m off": 120,
    "headings 3° off, taken for exact": 60,
    "drone 20 m off": 6,
    "noise 12 dB higher in half of the area": 12,
    "headings 12° off": 12,
}
"""Draws in which a fault shows with p < 0.003 already, where the experiment makes more."""
FEWER_RANKS = {"survey": 16, "tracker": 24, "path of a moving tag": 20}
"""About twice the draws in which its fault above shows."""


@pytest.mark.parametrize("fault", FAULTS)
def test_the_calibration_fails_with_a_seeded_fault(fault: str) -> None:
    _, draws, seeded = FAULTS[fault]
    assert p_uniform(seeded, count(FEWER_DRAWS.get(fault, draws), draws), 21) < LEAST_P


def test_the_default_is_better_than_the_original_by_far() -> None:
    results = {
        one.case: one.figure
        for one in EXPERIMENTS["B1, B2"](8, 12)
        if one.quantity == "rms [°]"
    }
    case = str(RotationCase())
    assert results[case] < 0.5 * results[f"{case}: pca"]


@pytest.mark.parametrize(
    ("case", "published"),
    [
        (RotationCase(), 2.01),
        (RotationCase(snr_db=30.0, fading_db=0.5), 0.55),
        (RotationCase(snr_db=13.0), 3.45),
        (RotationCase(pulses=20, fading_db=4.0), 5.47),
    ],
)
def test_the_bound_is_that_of_the_reference(case: RotationCase, published: float) -> None:
    """Ours averages over the phase of the headings."""
    assert bound_deg(case) == pytest.approx(published, rel=0.04)


def test_a_result_knows_its_bar_and_says_so() -> None:
    values = list(np.arange(101.0))
    within = measured("X1", "here", "median [m]", values, median, most=50.0)
    beyond = measured("X1", "here", "median [m]", values, median, least=51.0)
    assert (within.met, beyond.met) == (True, False)
    assert within.low < 50.0 < within.high
    verdicts = drawn([within, beyond]).splitlines()[1:]
    assert verdicts[0].endswith("met, within error")
    assert verdicts[1].endswith("not met, within error")


def test_a_result_without_a_bar_passes() -> None:
    free = Row(experiment="X", case="", quantity="", figure=1.0, low=0.0, high=2.0, n=3)
    assert free.met
    assert "met" not in drawn([free])


def test_the_command_prints_the_table_and_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    localization(runs=3, only="L5", output=tmp_path / "bars.csv")
    assert "of 1 requirements met" in capsys.readouterr().out
    with (tmp_path / "bars.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["experiment"] for row in rows] == ["L5", "L5"]
    assert [row["most"] == "" for row in rows] == [True, False]
    with pytest.raises(UsageError, match="B6"):
        localization(only="B99")
