"""The search for K pulses of one rate in the power of the grid's cells.

A hypothesis is a row, an anchor cell, the anchor's place among the K pulses, and an interval.
Its statistic is the anchor's power plus, for each other place, the largest power within the
jitter around where that pulse should be; all relative to the row's noise and none above a
limit. By the pigeonhole principle a sum of K terms that reaches T has a term that reaches T/K,
so only cells above T/K need be anchors: a few in a second of noise at K = 3. The maximum over
jitter is taken once for all cells; the work is linear in K (reference/perf.md §2c; the
original enumerates 3 to the power K patterns).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.grid import sliding_maximum

CELL_LIMIT = 14.0
"""Most that one cell adds to a sum of several, in noise powers: 0.5 of a K = 3 threshold.

Without a limit one impulse carries a group. The limit costs nothing at the threshold: it lowers
the false alarms of noise as much (measured: docs/explanation/detection.md)."""
_ANCHORS_AT_ONCE = 96
_CANDIDATES_AT_ONCE = 24
"""Of the strongest. A neighbour 10 dB above the tag fills eight with its flanks: for 36 pulses
the tag was not seen beside it."""
_DENSE_FROM_K = 9
_PIECE_S = 0.46
"""Most columns taken in at once, in seconds: a ring of cells needs no more beyond its span, and
a detector's pieces are of 0.44 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A hypothesis whose statistic reached the threshold."""

    score: float
    """The statistic over the threshold."""
    strength: float
    """The sum without the limit on a cell, in noise powers: settles ties of strong pulses."""
    rate: int
    row: int
    columns: tuple[float, ...]
    """Where its pulses should be, in columns since the start."""


class RateSearch:
    """Search of one rate over a sliding stretch of columns.

    Parameters
    ----------
    rows : int
        Rows of the grid.
    hop_s : float
        Time between two columns.
    interval_s, uncertainty_s, jitter_s : float
        The tag's interval, the bound of its constant error and of each pulse's own.
    k : int
        Pulses summed.
    threshold : float
        Of the sum, in noise powers.
    rate : int
        Number of the rate, from 1.
    first_threshold, first_columns : float, int
        Threshold while fewer columns than these have been seen. In the first decision interval
        few groups can have begun; it may spend its false alarms on these.
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
        self._steady_threshold = threshold
        self._first_columns = first_columns
        self.threshold = threshold if first_threshold is None else first_threshold
        self.limit = CELL_LIMIT if k > 1 else math.inf
        self._rows = rows
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
        """Columns from the first to the last pulse, at the longest interval."""
        places = np.arange(k)
        offsets = np.rint(
            (places[np.newaxis, :] - places[:, np.newaxis])[:, :, np.newaxis]
            * intervals[np.newaxis, np.newaxis, :]
        ).astype(np.intp)
        self._offsets = np.stack([np.delete(offsets[place], place, axis=0) for place in places])
        """(anchor places, k - 1, intervals): columns from the anchor to the others."""
        self._waits = np.ceil((k - 1 - places) * intervals[-1]).astype(np.intp)
        self.dense = k >= _DENSE_FROM_K
        self._backs = offsets[0].tolist() if self.dense else []
        """(k, intervals): columns from a pulse to the last, those of the last first."""
        self.columns = 0
        """Columns whose maxima over the jitter are known, since the start."""
        self._piece = max(16, math.ceil(_PIECE_S / hop_s))
        self._length = self.span + self._piece + 2
        shape = (self._length, rows) if self.dense else (rows, self._length)
        self._cells = np.zeros(shape, np.float32)
        """Maxima over the jitter, a ring: column c lies at c modulo the length. The cells of
        one row lie side by side, as an anchor looks at a stretch of them, out of the cache."""
        self._tail = np.zeros((rows, 0), np.float32)
        self._anchors = np.zeros((2, 0), np.intp)
        """Column and row of each, by column."""
        self._anchor_power = np.zeros(0, np.float32)
        self._tested = np.zeros(k, np.intp)
        """How many of the anchors were tested in each place."""
        self._searched = 0
        self.best = 0.0
        """Largest statistic over the threshold since it was last set to zero."""
        self.margin = 1.0
        """What the threshold is multiplied by while the noise is hardly known."""

    def begin_at(self, column: int) -> None:
        """Begin in mid-stream: the first column that will be pushed is this one."""
        self.columns = self._searched = column + self.reach
        self._first_columns = 0

    def push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        """Take new columns and test every hypothesis that they complete.

        Parameters
        ----------
        power : ndarray of float32, shape (columns, rows)
            Power of the cells, in the input's units.
        noise : ndarray of float32, shape (rows,)
            Noise power of each row, in the same units.

        Returns
        -------
        list of Candidate
            Best first; several may be of the same pulses.
        """
        if len(power) <= self._piece:
            return self._push(power, noise)
        found: list[Candidate] = []
        for first in range(0, len(power), self._piece):
            found += self._push(power[first : first + self._piece], noise)
        found.sort(key=lambda candidate: (-candidate.score, -candidate.strength))
        return found

    def _push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        """Take at most a piece of columns."""
        reach, tail = self.reach, self._tail
        if not self.columns and not tail.size:
            # The very first columns have no past: zeros stand for it.
            tail = np.zeros((self._rows, reach), np.float32)
        block = np.concatenate((tail, power.T), axis=1)
        columns = block.shape[1]
        if columns <= 2 * reach:
            self._tail = block
            return []
        largest = sliding_maximum(block.T, reach).T
        self._tail = block[:, columns - 2 * reach :].copy()
        first = self.columns
        self._append(largest)
        if self.columns > self._first_columns:
            self.threshold = self._steady_threshold
        if self.dense:
            return self._search_dense(noise)
        self._note_anchors(first, block[:, reach : columns - reach], largest, noise)
        return self._search_anchors(noise)

    def _note_anchors(
        self,
        first: int,
        middle: NDArray[np.float32],
        largest: NDArray[np.float32],
        noise: NDArray[np.float32],
    ) -> None:
        """Add the cells that may be anchors; shapes (rows, columns) and (rows,)."""
        needed = np.float32(self.threshold / self.k) * noise
        # In one dimension: for two NumPy walks through all cells, at 40 times the price.
        cells = (middle >= needed[:, np.newaxis]).reshape(-1).nonzero()[0]
        if not len(cells):
            return
        row, column = np.divmod(cells, middle.shape[1])
        power = middle[row, column]
        peaks = (power == largest[row, column]).nonzero()[0]
        peaks = peaks[column[peaks].argsort(kind="stable")]
        found = np.empty((2, len(peaks)), np.intp)
        column.take(peaks, out=found[0])
        row.take(peaks, out=found[1])
        found[0] += first
        self._anchors = np.concatenate((self._anchors, found), axis=1)
        self._anchor_power = np.concatenate((self._anchor_power, power[peaks]))

    def finish(self, noise: NDArray[np.float32]) -> list[Candidate]:
        """Test the hypotheses still open, as if only silence followed."""
        columns = self.longest * (self.k - 1) + 2 * self.reach + 1
        if self.columns <= self._first_columns:
            self._first_columns += columns
        return self.push(np.zeros((columns, self._rows), np.float32), noise)

    def _append(self, largest: NDArray[np.float32]) -> None:
        ring = self._cells if self.dense else self._cells.T
        new = largest.T
        at = self.columns % len(ring)
        before = min(len(new), len(ring) - at)
        ring[at : at + before] = new[:before]
        if before < len(new):
            ring[: len(new) - before] = new[before:]
        self.columns += len(new)

    def _search_anchors(self, noise: NDArray[np.float32]) -> list[Candidate]:
        """Test every anchor in every place whose last pulse the new columns complete."""
        found: list[Candidate] = []
        columns, power = self._anchors[0], self._anchor_power
        if not len(columns):
            return found
        done = self._tested
        upto = columns.searchsorted(self.columns - self._waits)
        counts = upto - done
        if counts.any():
            spans = list(zip(done.tolist(), upto.tolist(), strict=True))
            due = np.concatenate([self._anchors[:, low:high] for low, high in spans], axis=1)
            powers = np.concatenate([power[low:high] for low, high in spans])
            places = np.arange(self.k).repeat(counts)
            for first in range(0, len(powers), _ANCHORS_AT_ONCE):
                part = slice(first, first + _ANCHORS_AT_ONCE)
                self._test(found, due[:, part], powers[part], places[part], noise)
            if len(found) > 1:
                found.sort(key=lambda candidate: (-candidate.score, -candidate.strength))
        # Those tested as the first of K, which waits longest, are done with.
        keep = int(upto[0])
        self._tested = upto - keep
        if keep:
            self._anchors = self._anchors[:, keep:]
            self._anchor_power = power[keep:]
        return found

    def _test(
        self,
        found: list[Candidate],
        anchors: NDArray[np.intp],
        power: NDArray[np.float32],
        places: NDArray[np.intp],
        noise: NDArray[np.float32],
    ) -> None:
        """Sum over all intervals for some anchors; note those that reach the threshold."""
        column, row = anchors
        level = noise[row]
        limits = level * np.float32(self.limit) if self.k > 1 else np.full_like(level, np.inf)
        where = column[:, np.newaxis, np.newaxis] + self._offsets[places]
        where %= self._length
        where += (row * self._length)[:, np.newaxis, np.newaxis]
        cells = self._cells.reshape(-1).take(where)
        totals = np.minimum(cells, limits[:, np.newaxis, np.newaxis]).sum(axis=1)
        totals += np.minimum(power, limits)[:, np.newaxis]
        best = totals.max(axis=1) / level
        largest = float(best.max())
        self.best = max(self.best, largest / self.threshold)
        if largest < self.threshold * self.margin:
            return
        hits = np.flatnonzero(best >= self.threshold * self.margin)
        strengths = (cells[hits].sum(axis=1) + power[hits][:, np.newaxis]) / level[hits][
            :, np.newaxis
        ]
        # Of the intervals that the limit makes equal, the one with the most power.
        totals = totals[hits] / level[hits][:, np.newaxis]
        strengths[totals < best[hits][:, np.newaxis] - 0.01] = 0.0
        choice = strengths.argmax(axis=1)
        strength = strengths.max(axis=1)
        for hit in np.argsort(-strength)[:_CANDIDATES_AT_ONCE]:
            interval = float(self.intervals[int(choice[hit])])
            index = int(hits[hit])
            place = int(places[index])
            found.append(
                Candidate(
                    score=float(best[index]) / self.threshold,
                    strength=float(strength[hit]),
                    rate=self.rate,
                    row=int(row[index]),
                    columns=tuple(
                        int(column[index]) + (k - place) * interval for k in range(self.k)
                    ),
                )
            )

    def _search_dense(self, noise: NDArray[np.float32]) -> list[Candidate]:
        """Every cell as the last pulse, every interval: for many pulses in a small volume.

        Of the long past only columns where a pulse may lie are looked at: at K = 40 a third.
        """
        done, upto = self._searched, self.columns
        self._searched = upto
        if upto <= done:
            return []
        count = upto - done
        weight = (1.0 / noise).astype(np.float32)
        common = np.zeros((count, self._rows), np.float32)
        totals = [np.zeros_like(common) for _ in self.intervals]
        for backs in self._backs:
            low, least = done - max(backs), min(backs)
            columns = np.arange(low, upto - least)
            cells = self._cells.take(columns, axis=0, mode="wrap")
            cells *= weight
            np.minimum(cells, np.float32(self.limit), out=cells)
            if max(backs) == least:
                common += cells
                continue
            for total, back in zip(totals, backs, strict=True):
                at = done - back - low
                total += cells[at : at + count]
        found: list[Candidate] = []
        for interval, total in zip(self.intervals, totals, strict=True):
            total += common
            largest = total.max(axis=0)
            self.best = max(self.best, float(largest.max()) / self.threshold)
            for row in np.flatnonzero(largest >= self.threshold * self.margin):
                column = int(total[:, row].argmax())
                found.append(
                    Candidate(
                        score=float(total[column, row]) / self.threshold,
                        strength=float(total[column, row]),
                        rate=self.rate,
                        row=int(row),
                        columns=tuple(
                            done + column - (self.k - 1 - k) * float(interval)
                            for k in range(self.k)
                        ),
                    )
                )
        found.sort(key=lambda candidate: (-candidate.score, -candidate.strength))
        return found


def jitter_reach(jitter_s: float, hop_s: float) -> int:
    """Columns to look to either side of where a pulse should be.

    Two pulses that are both off by their utmost are rare, and a pulse a little beyond the reach
    is still seen by its flank: 0.7 of the bound loses less than the smaller search gains.
    """
    return max(1, math.ceil(0.7 * jitter_s / hop_s - 0.25))


def interval_grid(
    *, interval_s: float, uncertainty_s: float, hop_s: float, k: int, reach: int
) -> NDArray[np.float64]:
    """Intervals to try, in columns.

    They lie so close that between two of them no pulse of the K moves by more than the reach of
    the jitter or one column, whichever is the larger half.
    """
    middle = interval_s / hop_s
    if k == 1:
        return np.array([middle])
    spread = uncertainty_s / hop_s
    step = min(1.0, max(1.0, reach / 2.0) * 2.0 / (k - 1))
    count = 2 * math.ceil(spread / step) + 1 if spread > 0.0 else 1
    return middle + np.linspace(-spread, spread, count)
