"""Search for groups of pulses that contain an anchor: a cell strong enough to be a pulse."""

import bisect
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels
from uavrt.detection.search.hypotheses import Anchors, Candidate, RateSearch, best_first
from uavrt.detection.search.null_lattices import Lows, NullLattices
from uavrt.detection.search.tuning import GROUPS


class _AnchorMemory(RateSearch):
    """Ring buffer of cells, and the anchors in it whose groups are still to be tested."""

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        k, reach = self.k, self.reach
        self.waits = [
            GROUPS.measured_columns + math.ceil((k - 1 - p) * self.intervals[-1])
            for p in range(k)
        ]
        """(K,) number of columns from a strong cell to the end of its group, if the cell is the
        pulse with this index."""
        others = np.stack([np.delete(self._offsets[p], p, axis=0) for p in range(k)])
        first = others.min(axis=2, initial=np.iinfo(np.intp).max, keepdims=True)
        self.rest = others - first
        """(K, K - 1, intervals) delay of each other pulse after its earliest one [columns]."""
        self.lows = first[:, :, 0] - reach
        """(K, K - 1) number of columns from a strong cell to the first column searched for each
        other pulse, if the cell is the pulse with the first index."""
        self.stretch = int(self.rest.max(initial=0)) + 2 * reach + 1
        """Number of spectrogram columns searched for one other pulse of a group."""
        self.length = self.span + self.piece + 2 * reach + 4 + GROUPS.measured_columns
        """Number of columns in the ring buffer of cells; column c is at c modulo this."""
        self.width = self.length + max(self.stretch, self.piece + 2 * reach)
        """Width of the ring buffer [columns], with the first ones repeated after its end."""
        # Only when first needed: of a hundred tags 48 MB never are.
        self.memory = np.zeros(0, np.float32)
        self.pushed = 0
        self.anchor_columns: list[int] = []
        self.anchor_rows: list[int] = []
        self.anchor_powers: list[float] = []
        self.null: NullLattices | None = None
        self.tested = [0] * k
        """(K,) number of strong cells tested as each of a group's K pulses."""

    def begin_at(self, column: int) -> None:
        """Begin in the middle of a stream; `column` is the number of the first column."""
        super().begin_at(column)
        self.pushed = column

    def open_anchors(self) -> Anchors:
        """Return the anchors (strong cells) whose groups are still to be tested."""
        return self.anchor_columns, self.anchor_rows, self.anchor_powers

    def _append(self, power: NDArray[np.float32]) -> None:
        """Write new columns (rows, columns) into the ring buffer."""
        cells = self.memory.reshape(self.rows, self.width)
        count, length = power.shape[1], self.length
        at = self.pushed % length
        cells[:, at : at + count] = power
        # Repeated columns are written twice.
        if at + count > length:
            cells[:, : at + count - length] = power[:, length - at :]
        spare = cells.shape[1] - length
        if at < spare:
            twice = min(count, spare - at)
            cells[:, length + at : length + at + twice] = power[:, :twice]
        self.pushed += count

    @property
    def _fresh(self) -> int:
        """Number of new columns that have not yet been searched for anchors (strong cells)."""
        return max(0, self.pushed - self.reach - self.columns)

    def _advance(self, fresh: int) -> int:
        """Count columns as searched; return the ring buffer position of the first one."""
        first = self.columns % self.length
        self.columns += fresh
        if self.columns > self._first_columns:
            self.threshold = self._steady_threshold
        return first

    def _note(self, columns: list[int], rows: list[int], powers: list[float]) -> None:
        """Add anchors to be tested, in the order of their columns."""
        self.anchor_columns += columns
        self.anchor_rows += rows
        self.anchor_powers += powers

    def _note_anchors(self, noise: NDArray[np.float32], fresh: int) -> None:
        """Find the anchors in new columns: strong cells that are largest within the jitter."""
        first, reach = self.columns, self.reach
        at = self._advance(fresh)
        cells = self.memory.reshape(self.rows, self.width)[:, at : at + fresh]
        strong = cells >= (np.float32(self.threshold / self.k) * noise)[:, np.newaxis]
        # In one dimension: in two, NumPy visits all cells, at 40 times the cost.
        row, column = np.divmod(strong.reshape(-1).nonzero()[0], fresh)
        if not len(row):
            return
        starts = row * self.width + (at + column - reach) % self.length
        around = _stretches(self.memory, 2 * reach + 1)[starts]
        power = around[:, reach]
        peaks = (power >= around.max(axis=1)).nonzero()[0]
        peaks = peaks[column[peaks].argsort(kind="stable")]
        self._note((first + column)[peaks].tolist(), row[peaks].tolist(), power[peaks].tolist())

    def _take_due(self) -> "_Due":
        """Take the anchors whose groups are complete."""
        due = _Due()
        columns, tested = self.anchor_columns, self.tested
        if not columns:
            return due
        for place, wait in enumerate(self.waits):
            done = tested[place]
            upto = bisect.bisect_left(columns, self.columns - wait, done)
            if upto > done:
                due.columns += columns[done:upto]
                due.rows += self.anchor_rows[done:upto]
                due.powers += self.anchor_powers[done:upto]
                due.places += [place] * (upto - done)
                tested[place] = upto
        # Anchors tested as the first of K, which takes longest, are finished.
        keep = tested[0]
        if keep:
            if self.pass_on is not None:
                self.pass_on(columns[:keep], self.anchor_rows[:keep], self.anchor_powers[:keep])
            del columns[:keep], self.anchor_rows[:keep], self.anchor_powers[:keep]
            self.tested = [upto - keep for upto in tested]
        return due


class AnchorSearch(_AnchorMemory):
    """Search at one rate for groups of up to eight pulses; parameters as for `RateSearch`."""

    def count_null(self, expected_per_column: float, interval: float) -> None:
        """Count groups at intervals that no tag has; a large number raises the threshold."""
        if self.k > 1:
            self.null = NullLattices(
                lows=self.lows,
                interval=interval,
                expected_per_column=expected_per_column,
                threshold=self._steady_threshold,
                limit=self.limit,
            )

    @property
    def margin(self) -> float:
        """Factor on the threshold that accounts for the present noise."""
        if self.null is None:
            return self.own_margin
        return self.own_margin * self.null.factor(self.threshold)

    def _push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        if not len(self.memory):
            # The beginning of the ring buffer is repeated after its end, so that every stretch
            # of a row is contiguous.
            self.memory = np.zeros(self.rows * self.width, np.float32)
        if kernels() is not None:
            return self._push_by_kernel(power, noise)
        self._append(power)
        fresh = self._fresh
        if not fresh:
            return []
        self._note_anchors(noise, fresh)
        due = self._take_due()
        self._count_null(due, noise, fresh)
        return best_first(self._tested_candidates(due, noise)) if due.columns else []

    def _push_by_kernel(
        self, power: NDArray[np.float32], level: NDArray[np.float32]
    ) -> list[Candidate]:
        native = kernels()
        if power.strides[1] != power.itemsize:
            power = np.ascontiguousarray(power)
        at, first = self.pushed % self.length, self.columns
        self.pushed += power.shape[1]
        fresh = self._fresh
        begin = self._advance(fresh) if fresh else 0
        ring = (self.memory, 0, self.rows, self.width, self.length)
        share = self.threshold / self.k
        self._note(
            *native.note(*ring, at, begin, fresh, first, self.reach, share, level, power)
        )
        due = self._take_due() if fresh else _Due()

        def rated(lows: Lows, least: float, limit: float) -> Any:
            return native.rate(
                *(*ring, self.stretch, self.reach, limit, lows, self.rest, level),
                *(due.columns, due.rows, due.powers, due.places, least),
            )

        null = self.null
        if fresh and null is not None:
            counted, low = null.least(self.threshold), null.cell_limit(self.threshold)

            def makes_group(lows: Lows, shorter: int) -> bool:
                hits = rated(lows, counted, low)[1]
                return bool(hits) and bool(self._candidates(due, hits, shorter))

            null.count(fresh, makes_group if due.columns else None)
        if not due.columns:
            return []
        largest, hits = rated(self.lows, self.threshold * self.margin, self.limit)
        self.best = max(self.best, largest / self.threshold)
        if hits and len(due.columns) > GROUPS.anchors_at_once:
            return best_first(self._tested_candidates(due, level))
        return best_first(self._candidates(due, hits)) if hits else []

    def _count_null(self, due: "_Due", noise: NDArray[np.float32], fresh: int) -> None:
        """Test for groups at the intervals of the null lattices, as in the search itself."""
        null = self.null
        if null is None:
            return
        least, limit = null.least(self.threshold), null.cell_limit(self.threshold)

        def makes_group(lows: Lows, shorter: int) -> bool:
            tested = self._test(due, noise, lows, limit)
            some = bool((tested.best >= least).any())
            return some and bool(self._collect(tested, least, shorter))

        null.count(fresh, makes_group if due.columns else None)

    def _tested_candidates(self, due: "_Due", noise: NDArray[np.float32]) -> list[Candidate]:
        """Test all due anchors; return the candidates that reach the threshold."""
        found = []
        for first in range(0, len(due.columns), GROUPS.anchors_at_once):
            some = due.part(slice(first, first + GROUPS.anchors_at_once))
            tested = self._test(some, noise, self.lows, self.limit)
            largest = float(tested.best.max())
            self.best = max(self.best, largest / self.threshold)
            least = self.threshold * self.margin
            if largest >= least:
                found += self._collect(tested, least)
        return found

    def _test(
        self, due: "_Due", noise: NDArray[np.float32], lows: NDArray[np.intp], limit: float
    ) -> "_Tested":
        """Test each anchor at its place in the group, with every interval."""
        reach = self.reach
        column, row, place = np.array(due.columns), np.array(due.rows), np.array(due.places)
        power = np.array(due.powers, np.float32)
        level = noise[row]
        limits = level * np.float32(limit) if self.k > 1 else np.full_like(level, np.inf)
        where = (column[:, np.newaxis] + lows[place]) % self.length
        where += (row * self.width)[:, np.newaxis]
        # Maxima over the jitter along each other pulse's columns, by doubling.
        largest = _stretches(self.memory, self.stretch)[where]
        covered = 1
        while covered < 2 * reach + 1:
            shift = min(covered, 2 * reach + 1 - covered)
            largest = np.maximum(largest[..., :-shift], largest[..., shift:])
            covered += shift
        starts = np.arange(where.size) * largest.shape[2]
        at = self.rest[place] + starts.reshape(where.shape)[:, :, np.newaxis]
        cells = largest.reshape(-1).take(at)
        totals = np.minimum(cells, limits[:, np.newaxis, np.newaxis]).sum(axis=1)
        totals += np.minimum(power, limits)[:, np.newaxis]
        return _Tested(
            column=column,
            row=row,
            place=place,
            power=power,
            level=level,
            cells=cells,
            totals=totals,
            best=totals.max(axis=1) / level,
        )

    def _collect(self, tested: "_Tested", least: float, shorter: int = 0) -> list[Candidate]:
        """Create candidates from the tested anchors whose sum is at least `least`."""
        hits = np.flatnonzero(tested.best >= least)
        best, level = tested.best[hits], tested.level[hits][:, np.newaxis]
        strengths = (tested.cells[hits].sum(axis=1) + tested.power[hits][:, np.newaxis]) / level
        # Of intervals made equal by the limit, take the one with the most power.
        strengths[tested.totals[hits] / level < best[:, np.newaxis] - 0.01] = 0.0
        strength = strengths.max(axis=1)
        strongest = np.argsort(-strength)[: GROUPS.candidates_at_once]
        which = hits[strongest]
        interval = self.intervals[strengths.argmax(axis=1)[strongest]] - shorter
        after = np.arange(self.k) - tested.place[which][:, np.newaxis]
        columns = tested.column[which][:, np.newaxis] + after * interval[:, np.newaxis]
        return self._unknown(best[strongest], strength[strongest], tested.row[which], columns)

    def _candidates(
        self, due: "_Due", hits: list[tuple[int, float, float, int]], shorter: int = 0
    ) -> list[Candidate]:
        """Create candidates from anchors that the compiled kernel found above the threshold."""
        hits = sorted(hits, key=lambda hit: -hit[2])[: GROUPS.candidates_at_once]
        which, score, strength, interval = zip(*hits, strict=True)
        place = np.array([due.places[index] for index in which])
        column = np.array([due.columns[index] for index in which])
        after = np.arange(self.k) - place[:, np.newaxis]
        columns = column[:, np.newaxis] + after * (
            self.intervals[list(interval), np.newaxis] - shorter
        )
        row = np.array([due.rows[index] for index in which])
        return self._unknown(np.array(score), np.array(strength), row, columns)

    def _unknown(
        self,
        score: NDArray[np.floating],
        strength: NDArray[np.floating],
        row: NDArray[np.intp],
        columns: NDArray[np.float64],
    ) -> list[Candidate]:
        if self.known is not None:
            new = ~self.known.explain(columns, row, strength, reach=self.reach)
            if not new.any():
                return []
            score, strength, row, columns = score[new], strength[new], row[new], columns[new]
        threshold = self.threshold
        return [
            Candidate(one / threshold, strong, self.rate, at, tuple(where))
            for one, strong, at, where in zip(
                score.tolist(), strength.tolist(), row.tolist(), columns.tolist(), strict=True
            )
        ]


@dataclass(slots=True)
class _Due:
    """Anchors to be tested: columns, rows, powers, and their places among the K pulses."""

    columns: list[int] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    powers: list[float] = field(default_factory=list)
    places: list[int] = field(default_factory=list)

    def part(self, some: slice) -> "_Due":
        return _Due(self.columns[some], self.rows[some], self.powers[some], self.places[some])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Tested:
    """Powers and sums of the groups tested for each anchor, before division by the noise."""

    column: NDArray[np.intp]
    row: NDArray[np.intp]
    place: NDArray[np.intp]
    power: NDArray[np.float32]
    level: NDArray[np.float32]
    cells: NDArray[np.float32]
    """(anchors, k - 1, intervals) largest power near the expected time of each further pulse of
    the group, within the jitter."""
    totals: NDArray[np.float32]
    """(anchors, intervals) sums of a group's powers, each limited to one cell's maximum."""
    best: NDArray[np.float32]
    """(anchors,) largest sum of powers over the intervals, for each anchor [noise powers]."""


def _stretches(memory: NDArray[np.float32], length: int) -> NDArray[np.float32]:
    """View of all stretches of `length` contiguous cells of a row, without a copy."""
    return np.ndarray((len(memory) - length + 1, length), np.float32, memory, 0, (4, 4))
