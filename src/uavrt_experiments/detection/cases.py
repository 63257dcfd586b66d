"""Cases of the detector's experiments, each with its trials and its rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uavrt_experiments.result import Row

FULL_TRIALS = 600
"""Decisions for each point of a Pd curve at full size; `Case.trials` refer to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Trials of one kind, and their evaluation."""

    name: str
    trials: int
    """Trials at full size."""
    seconds: float
    """Approximate CPU time of one trial, for the shares of the processes and the progress
    bar."""
    trial: Callable[[np.random.Generator, int], Any]
    """Runs a trial from a generator and the trial's number; returns a picklable outcome."""
    rows: Callable[[Sequence[Any]], list[Row]]
    """Makes rows from all outcomes, ordered by number."""
    least: int = 1
    """Trials at any size."""
    alone: bool = False
    """True for a time measurement: run when no other process works."""
    short: "Case | None" = None
    """Replacement in the tests, where few of its own trials take long or show little."""

    def count(self, trials: int) -> int:
        """Trials of this case for a given number per point of a Pd curve."""
        return max(self.least, round(self.trials * trials / FULL_TRIALS))


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One acceptance experiment."""

    name: str
    title: str
    cases: tuple[Case, ...] = field(default_factory=tuple)
