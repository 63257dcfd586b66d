"""Cases of the detector's experiments, each with its trials and its rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uavrt_experiments.result import Row

FULL_TRIALS = 600
"""Decisions for each point of a Pd curve at full size; `Case.trials` is relative to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Trials of one kind, and their evaluation."""

    name: str
    trials: int
    """Number of trials at full size."""
    seconds: float
    """Approximate CPU time of one trial [s], to share the work and for the progress bar."""
    trial: Callable[[np.random.Generator, int], Any]
    """Runs one trial from a generator and the trial's number; returns a picklable outcome."""
    rows: Callable[[Sequence[Any]], list[Row]]
    """Makes rows from all outcomes, in order of the trials' numbers."""
    least: int = 1
    """Smallest number of trials, whatever the requested size."""
    alone: bool = False
    """True for a time measurement, which runs while no other process works."""
    short: "Case | None" = None
    """Short form for the tests, if few of the case's own trials take long or show little; else
    None."""

    def count(self, trials: int) -> int:
        """Number of trials of this case for a given number per point of a Pd curve."""
        return max(self.least, round(self.trials * trials / FULL_TRIALS))


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One acceptance experiment."""

    name: str
    title: str
    cases: tuple[Case, ...] = field(default_factory=tuple)
