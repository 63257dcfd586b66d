"""Search for groups of nine pulses or more: try every cell as the last pulse. For such K, one
cell in ten exceeds T/K (threshold over number of pulses), so a search from strong cells would
save nothing. The maximum over the jitter is computed once for all cells.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import ROWS_PER_BIN, sliding_maximum
from uavrt.detection.search.hypotheses import Candidate, RateSearch, best_first
from uavrt.detection.search.tuning import GROUPS, THRESHOLDS


class LongSearch(RateSearch):
    """Search at one rate for groups of nine pulses or more; parameters as for `RateSearch`."""

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        self._backs = self._offsets[0].tolist()
        """(K, intervals): columns from a group's last pulse back to each pulse, last first."""
        self._cells = np.zeros((self.span + self.piece + 2, self.rows), np.float32)
        """Ring buffer of maxima over the pulses' jitter; column c is at c modulo its length."""
        self._tail = np.zeros((self.rows, 0), np.float32)
        self._searched = 0

    def begin_at(self, column: int) -> None:
        """Begin in the middle of a stream; `column` is the number of the first column."""
        super().begin_at(column)
        self._searched = self.columns

    def _push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        reach, tail = self.reach, self._tail
        if self.pass_on is not None:
            self._pass_on(power, noise)
        if not self.columns and not tail.size:
            # The first columns have no past: use zeros.
            tail = np.zeros((self.rows, reach), np.float32)
        block = np.concatenate((tail, power), axis=1)
        columns = block.shape[1]
        if columns <= 2 * reach:
            self._tail = block
            return []
        largest = sliding_maximum(block.T, reach)
        self._tail = block[:, columns - 2 * reach :].copy()
        ring = self._cells
        at = self.columns % len(ring)
        before = min(len(largest), len(ring) - at)
        ring[at : at + before] = largest[:before]
        if before < len(largest):
            ring[: len(largest) - before] = largest[before:]
        self.columns += len(largest)
        if self.columns > self._first_columns:
            self.threshold = self._steady_threshold
        return self._search_dense(noise)

    def _pass_on(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> None:
        """Pass new strong cells to `pass_on`, if each is the largest of its time in its row."""
        row, column = np.nonzero(power >= THRESHOLDS.least_power * noise[:, np.newaxis])
        if not len(row):
            return
        strong = power[row, column]
        top = strong >= power[row, np.maximum(column - 1, 0)]
        top &= strong >= power[row, np.minimum(column + 1, power.shape[1] - 1)]
        row, column, strong = row[top], column[top], strong[top]
        order = column.argsort(kind="stable")
        # Columns before the first are the maxima's margin.
        begin = self.columns + (self._tail.shape[1] - self.reach if self._tail.size else 0)
        assert self.pass_on is not None
        self.pass_on(
            (column[order] + begin).tolist(), row[order].tolist(), strong[order].tolist()
        )

    def _search_dense(self, noise: NDArray[np.float32]) -> list[Candidate]:
        """Try every cell as a group's last pulse, with all intervals; best candidates first."""
        done, upto = self._searched, self.columns
        self._searched = upto
        if upto <= done:
            return []
        totals = self._totals(done, upto, noise, self.limit)
        largest = np.stack([total.max(axis=0) for total in totals])
        self.best = max(self.best, float(largest.max()) / self.threshold)
        least = self.threshold * self.margin
        if not (largest >= least).any():
            return []
        # At the limit all cells around a strong tag are equal: the power decides.
        strengths = self._totals(done, upto, noise, math.inf)
        column = np.empty(largest.shape, np.intp)
        strength = np.empty_like(largest)
        for i, (total, power) in enumerate(zip(totals, strengths, strict=True)):
            power[total < least] = 0.0
            column[i] = power.argmax(axis=0)
            strength[i] = power[column[i], np.arange(self.rows)]
        best = strength.argmax(axis=0)
        found: list[Candidate] = []
        for row in _tops(strength.max(axis=0)):
            choice = int(best[row])
            at = int(column[choice, row])
            if at == upto - done - 1:
                # Possibly before the maximum, 6 ms early: examine it again in the next step.
                self._searched = upto - 1
                continue
            interval = float(self.intervals[choice])
            found.append(
                Candidate(
                    score=float(totals[choice][at, row]) / self.threshold,
                    strength=float(strength[choice, row]),
                    rate=self.rate,
                    row=row,
                    columns=tuple(
                        done + at - (self.k - 1 - k) * interval for k in range(self.k)
                    ),
                )
            )
        return best_first(found)

    def _totals(
        self, done: int, upto: int, noise: NDArray[np.float32], limit: float
    ) -> list[NDArray[np.float32]]:
        """Sums of group powers per interval, (upto - done, rows) by the last pulse's column."""
        count = upto - done
        weight = (1.0 / noise).astype(np.float32)
        common = np.zeros((count, self.rows), np.float32)
        totals = [np.zeros_like(common) for _ in self.intervals]
        for backs in self._backs:
            low, least = done - max(backs), min(backs)
            columns = np.arange(low, upto - least)
            cells = self._cells.take(columns, axis=0, mode="wrap")
            cells *= weight
            np.minimum(cells, np.float32(limit), out=cells)
            if max(backs) == least:
                common += cells
                continue
            for total, back in zip(totals, backs, strict=True):
                at = done - back - low
                total += cells[at : at + count]
        for total in totals:
            total += common
        return totals


def _tops(strength: NDArray[np.float32]) -> list[int]:
    """Rows stronger than all rows within one frequency bin; only the strongest few."""
    padded = np.pad(strength, ROWS_PER_BIN)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * ROWS_PER_BIN + 1)
    tops = np.flatnonzero((strength > 0.0) & (strength >= around.max(axis=1)))
    return [
        int(row) for row in tops[np.argsort(-strength[tops])][: GROUPS.long_candidates_at_once]
    ]
