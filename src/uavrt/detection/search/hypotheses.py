"""Search for K pulses of one rate in the power of the grid's cells.

A hypothesis consists of a frequency row, a strong cell (anchor), the anchor's number among the
K pulses, and an interval. Its statistic is the anchor's power plus, for each other pulse, the
largest power within the jitter around the expected time. All powers are relative to the row's
noise and limited. If a sum of K terms reaches T, one of the terms reaches T/K. So only cells
above T/K need to be anchors: for K = 3 there are a few per second of noise. The work is
proportional to K.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.known_pulses import KnownPulses
from uavrt.detection.search.tuning import GROUPS

Anchors = tuple[list[int], list[int], list[float]]
"""Columns, rows and powers of strong spectrogram cells, in order of time."""


class Candidate(NamedTuple):
    """Hypothesis (row, anchor, interval) with a statistic above the threshold."""

    score: float
    """Ratio of the candidate's sum of powers to the detection threshold."""
    strength: float
    """Sum of powers without the limit on each cell [noise powers]; decides between equal
    scores."""
    rate: int
    row: int
    columns: tuple[float, ...]
    """Expected spectrogram column of each pulse, counted from the start of the stream."""


def best_first(found: list[Candidate]) -> list[Candidate]:
    """Sort candidates in place by score, and those of equal score by strength."""
    if len(found) > 1:
        found.sort(key=lambda one: (-round(one.score, GROUPS.score_digits), -one.strength))
    return found


class RateSearch(ABC):
    """Base class of searches for groups of one pulse rate, in columns as they arrive.

    In the first `first_columns`, the threshold is `first_threshold`. It may be lower than the
    later threshold, because few groups begin there.
    """

    def __init__(
        self,
        *,
        rows: int,
        hop_s: float,
        interval_s: float,
        uncertainty_s: float,
        jitter_s: float,
        k: int,
        threshold: float,
        rate: int,
        first_threshold: float | None = None,
        first_columns: int = 0,
    ) -> None:
        self.rate = rate
        self.k = k
        self.rows = rows
        self._steady_threshold = threshold
        self._first_columns = first_columns
        self.threshold = threshold if first_threshold is None else first_threshold
        self.limit = GROUPS.cell_limit if k > 1 else math.inf
        self.reach = jitter_reach(jitter_s, hop_s)
        intervals = interval_grid(
            interval_s=interval_s,
            uncertainty_s=uncertainty_s,
            hop_s=hop_s,
            k=k,
            reach=self.reach,
        )
        self.intervals = intervals
        self.longest = math.ceil(float(intervals[-1]))
        self.span = (k - 1) * self.longest + 1
        """Number of columns from a group's first pulse to its last at the longest interval."""
        places = np.arange(k)
        self._offsets = np.rint(
            (places[np.newaxis, :] - places[:, np.newaxis])[:, :, np.newaxis]
            * intervals[np.newaxis, np.newaxis, :]
        ).astype(np.intp)
        """(K, K, intervals): columns from one of a group's pulses to another."""
        self.columns = 0
        """Number of spectrogram columns with known maxima over the pulses' jitter."""
        self.piece = max(16, math.ceil(GROUPS.piece_s / hop_s))
        self.best = 0.0
        """Maximum ratio of a group's sum of powers to its threshold since the last reset."""
        self.own_margin = 1.0
        """Factor on the detection threshold while the noise estimate is still inaccurate."""
        self.known: KnownPulses | None = None
        """Pulses of confirmed tracks; candidates that they explain are not returned."""
        self.pass_on: Callable[[list[int], list[int], list[float]], None] | None = None
        """Callback for strong cells that the search has finished: columns, rows, powers."""

    def open_anchors(self) -> Anchors:
        """Return the strong cells with groups that later columns may complete."""
        return [], [], []

    @property
    def margin(self) -> float:
        """Factor on the threshold that accounts for the present noise."""
        return self.own_margin

    @property
    def steady(self) -> bool:
        """True once the start's threshold, `first_threshold`, no longer applies."""
        return self.threshold == self._steady_threshold

    def begin_at(self, column: int) -> None:
        """Begin in the middle of a stream; `column` is the number of the first column."""
        self.columns = column + self.reach
        self._first_columns = 0

    def push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        """Add new columns; return the candidates that they complete, best first."""
        found: list[Candidate] = []
        for first in range(0, len(power), self.piece):
            found += self._push(power[first : first + self.piece].T, noise)
        return best_first(found)

    def finish(self, noise: NDArray[np.float32]) -> list[Candidate]:
        """Test the remaining hypotheses, assuming silence after the last column."""
        columns = self.longest * (self.k - 1) + 2 * self.reach + 1 + GROUPS.measured_columns
        if self.columns <= self._first_columns:
            self._first_columns += columns
        return self.push(np.zeros((columns, self.rows), np.float32), noise)

    @abstractmethod
    def _push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        """Add at most `piece` new columns of powers (rows, columns), with their noise."""


def jitter_reach(jitter_s: float, hop_s: float) -> int:
    """Number of columns searched on either side of a pulse: 0.7 times the maximum jitter.

    Two pulses that both deviate by the maximum are rare, and the flank of a pulse just outside
    the searched columns is still detected. So the smaller search gains more sensitivity than it
    loses.
    """
    return max(1, math.ceil(0.7 * jitter_s / hop_s - 0.25))


def interval_grid(
    *, interval_s: float, uncertainty_s: float, hop_s: float, k: int, reach: int
) -> NDArray[np.float64]:
    """Intervals to try [columns].

    From one to the next, the last pulse moves by at most 2 columns, or `reach` columns.
    """
    middle = interval_s / hop_s
    if k == 1:
        return np.array([middle])
    spread = uncertainty_s / hop_s
    step = min(1.0, max(1.0, reach / 2.0) * 2.0 / (k - 1))
    count = 2 * math.ceil(spread / step) + 1 if spread > 0.0 else 1
    return middle + np.linspace(-spread, spread, count)
