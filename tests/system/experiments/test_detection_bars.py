"""Bars of the detector, measured in several processes."""

from dataclasses import replace

import pytest

from uavrt_experiments.detection.campaign import Chunk, run_chunk, run_experiments
from uavrt_experiments.detection.cases import Experiment
from uavrt_experiments.detection.catalogue import EXPERIMENTS


def test_two_processes_make_the_rows_that_one_makes() -> None:
    case = next(c for c in EXPERIMENTS["E2"].cases if c.name == "K = 1")
    number = EXPERIMENTS["E2"].cases.index(case)
    one = replace(EXPERIMENTS["E2"], cases=EXPERIMENTS["E2"].cases[number : number + 1])
    alone = run_chunk(Chunk(experiment="E2", case=number, first=0, last=40, seed=3))
    parts: list[float] = []
    # A process finds a case by its number: the experiment must be the catalogue's own.
    small = Experiment(
        name="E2",
        title=one.title,
        cases=tuple(
            c if c is case else replace(c, trials=0, least=1, rows=lambda outcomes: [])
            for c in EXPERIMENTS["E2"].cases
        ),
    )
    rows = run_experiments(
        [small], trials=1, seed=3, workers=2, on_progress=lambda part, what: parts.append(part)
    )
    assert rows == case.rows(alone)
    assert parts == sorted(parts)
    assert parts[-1] == pytest.approx(1.0)
