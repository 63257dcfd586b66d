"""All experiments on the evaluation of whole flights, and their runner."""

import zlib
from collections.abc import Callable, Iterable

import numpy as np

from uavrt.core.errors import UsageError
from uavrt_experiments.detection.cases import Experiment
from uavrt_experiments.integrate.cost import I5
from uavrt_experiments.integrate.false_alarms import I1
from uavrt_experiments.integrate.place import I4
from uavrt_experiments.integrate.region_bars import I8
from uavrt_experiments.integrate.sensitivity import I2, I3
from uavrt_experiments.integrate.several import I6
from uavrt_experiments.integrate.ways import I7
from uavrt_experiments.result import Row

EXPERIMENTS: dict[str, Experiment] = {one.name: one for one in (I1, I2, I3, I4, I5, I6, I7, I8)}
FOLDERS = ("localization/whole_flight", "detection")
"""Folders of the package whose code the figures depend on."""


def run_all(
    experiments: Iterable[Experiment],
    *,
    trials: int,
    seed: int,
    case: str = "",
    on_progress: Callable[[float, str], None] = lambda part, what: None,
) -> list[Row]:
    """Run experiments and make their rows.

    `trials`: flights for a curve of detection; everything else in proportion.
    `seed`: seeds everything random, with a case's name and a flight's number.
    `case`: only cases with this in their names.
    `on_progress`: receives the share done, by expected CPU time, and the last case.

    Raises `UsageError` if there is no such case.
    """
    pairs = [(e, one) for e in experiments for one in e.cases]
    chosen = [(e, one) for e, one in pairs if case in one.name]
    if not chosen:
        raise UsageError(
            f'no case has "{case}" in its name',
            remedy=f"Choose from {'; '.join(one.name for _, one in pairs)}",
        )
    total = sum(one.count(trials) * one.seconds for _, one in chosen) or 1.0
    done, rows = 0.0, []
    for experiment, one in chosen:
        key = zlib.crc32(f"{experiment.name} {one.name}".encode())
        outcomes = []
        for index in range(one.count(trials)):
            outcomes.append(one.trial(np.random.default_rng((seed, key, index)), index))
            done += one.seconds
            on_progress(done / total, f"{experiment.name} {one.name}")
        rows += one.rows(outcomes)
    return rows
