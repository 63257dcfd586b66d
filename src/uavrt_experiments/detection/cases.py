"""What an experiment on the detector is made of: cases, each with its trials and its rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uavrt_experiments.result import Row

FULL_TRIALS = 600
"""Decisions for each point of a Pd curve that the bars ask for; `Case.trials` refer to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Trials of one kind and what they are judged by."""

    name: str
    trials: int
    """At full size."""
    seconds: float
    """CPU time of one trial, roughly: for the shares of the processes and the progress bar."""
    trial: Callable[[np.random.Generator, int], Any]
    """Takes a generator and the trial's number; gives an outcome that can be sent."""
    rows: Callable[[Sequence[Any]], list[Row]]
    """Takes all outcomes in the order of their numbers."""
    least: int = 1
    """Trials at any size."""
    alone: bool = False
    """Times something: run when no other process works."""
    short: "Case | None" = None
    """What stands for it in the tests, where few of its own trials take long or show little."""

    def count(self, trials: int) -> int:
        """Trials of this case for a given number per point of a Pd curve."""
        return max(self.least, round(self.trials * trials / FULL_TRIALS))


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One acceptance experiment."""

    name: str
    title: str
    cases: tuple[Case, ...] = field(default_factory=tuple)
