"""Reject long groups that are another tag's pulses, by measuring their interval.

A window half a pulse width off still has a quarter of a pulse's power. With an interval that is
wrong by some milliseconds, ten or more of twenty expected pulses have such power. So the sum at
the declared interval is compared with sums at other intervals that share some pulses.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import Grid, sliding_maximum
from uavrt.detection.search.hypotheses import Candidate, RateSearch
from uavrt.detection.search.refine import Refiner
from uavrt.detection.track.bounds import Bounds
from uavrt.detection.track.tuning import JUDGE


class Intervals:
    """Tests whether another interval fits long groups of one detector better."""

    def __init__(self, bounds: Bounds, *, grid: Grid, refiner: Refiner) -> None:
        self._bounds = bounds
        self._grid = grid
        self._refiner = refiner

    def foreign_places(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """(K,) True for pulses of a candidate that another interval explains better."""
        hop = self._grid.hop
        places = np.arange(search.k)
        none = np.zeros(search.k, np.bool_)
        starts = np.array([self._grid.start(column) for column in candidate.columns])
        within, width = self._within(search), self._grid.window / hop
        change = _changes(within, JUDGE.crossing_widths * width, search.k)
        own = (starts[-1] - starts[0]) / (search.k - 1) / hop
        change += self._nominal(search) - own
        most = math.ceil(float(np.abs(change).max()) * (search.k - 1)) + 3
        cells = self._cells(candidate, search, starts, most, noise)
        if cells is None:
            return none
        # A train is described by its interval difference and the pulse at which it crosses.
        crossing = places[np.newaxis, :] - places[:, np.newaxis]
        shift = np.rint(change[:, np.newaxis, np.newaxis] * crossing).astype(np.intp) + most
        sums = np.zeros((3, *shift.shape[:2]))
        for late in range(3):
            for place in places.tolist():
                sums[late] += cells[place][shift[:, :, place] + late - 1]
        inside = np.abs(change - (self._nominal(search) - own)) <= within
        best = np.where(inside[:, np.newaxis], -math.inf, sums)
        if float(best.max()) < float(sums[:, inside].max()) + JUDGE.crossing_lead:
            return none
        after, which, cross = np.unravel_index(int(best.argmax()), best.shape)
        away = change[which] * crossing[cross] + after - 1.0
        return np.asarray(np.abs(away) < width + search.reach)

    def _within(self, search: RateSearch) -> float:
        most_s = self._bounds.most_interval_error_s(search.rate)
        return most_s * self._grid.sample_rate_hz / self._grid.hop

    def _nominal(self, search: RateSearch) -> float:
        interval_s = self._bounds.tag.pulse_intervals_s[search.rate - 1]
        return interval_s * self._grid.sample_rate_hz / self._grid.hop

    def _cells(
        self,
        candidate: Candidate,
        search: RateSearch,
        starts: NDArray[np.float64],
        most: int,
        noise: NDArray[np.float32],
    ) -> NDArray[np.float32] | None:
        """Powers around each expected pulse: the largest within the jitter, each limited."""
        hop, reach = self._grid.hop, search.reach
        offset_hz = float(self._grid.offsets_hz[candidate.row])
        side = (most + reach) * hop
        first = np.rint(starts).astype(np.int64) - side
        power, moved = self._refiner.powers(first, 2 * side + 1, offset_hz, 0.0, 1)
        if power is None:
            return None
        level = [self._refiner.noise_at(offset_hz, noise, at) for at in starts.tolist()]
        cells = np.zeros((search.k, 2 * (most + reach) + 1), np.float32)
        for place, shift in enumerate(moved.tolist()):
            at = np.arange(cells.shape[1]) * hop - shift
            there = (at >= 0) & (at < power.shape[2])
            cells[place, there] = power[place, 0, at[there]]
            cells[place] /= self._grid.window * level[place]
        np.minimum(cells, np.float32(search.limit), out=cells)
        return sliding_maximum(cells.T, reach).T


def _changes(within: float, beyond: float, k: int) -> NDArray[np.float64]:
    """Interval differences to try [columns]; each step moves the two ends of a group by two."""
    most = within + beyond
    step = 2.0 / (k - 1)
    count = math.ceil(most / step)
    return np.linspace(-most, most, 2 * count + 1)
