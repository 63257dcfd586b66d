"""Search for groups of pulses that contain an anchor: a cell strong enough to be a pulse.

Several tags are searched together, with their cells and hypotheses in one long array, because a
call of NumPy takes longer than its work for a single tag.
"""

import bisect
import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels
from uavrt.detection.search.hypotheses import Anchors, Candidate, RateSearch, best_first
from uavrt.detection.search.null_lattices import NullLattices
from uavrt.detection.search.tuning import GROUPS


class AnchorSearch(RateSearch):
    """Search at one rate for groups of up to eight pulses; parameters as for `RateSearch`."""

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
        self.base = 0
        # Separate memory only when first needed: in a group of a hundred tags 48 MB never are.
        self.memory = np.zeros(0, np.float32)
        self.cells = self.memory.reshape(0, self.width)
        self.pushed = 0
        self.anchor_columns: list[int] = []
        self.anchor_rows: list[int] = []
        self.anchor_powers: list[float] = []
        self.null: NullLattices | None = None
        self.tested = [0] * k
        """(K,) number of strong cells tested as each of a group's K pulses."""

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

    def begin_at(self, column: int) -> None:
        """Begin in the middle of a stream; `column` is the number of the first column."""
        super().begin_at(column)
        self.pushed = column

    def _push(self, power: NDArray[np.float32], noise: NDArray[np.float32]) -> list[Candidate]:
        return search_together([self], power[np.newaxis], noise[np.newaxis])[0]

    def open_anchors(self) -> Anchors:
        """Return the anchors (strong cells) whose groups are still to be tested."""
        return self.anchor_columns, self.anchor_rows, self.anchor_powers

    def kind(self) -> tuple[int, ...]:
        """Settings that must be equal for searches in one call of `search_together`."""
        return self.rows, self.k, self.reach, len(self.intervals)

    @property
    def size(self) -> int:
        """Number of cells in the ring buffer."""
        return self.rows * self.width

    def move_to(self, memory: NDArray[np.float32], base: int, *, empty: bool = False) -> None:
        """Move the ring buffer to index `base` of `memory`; `empty`: without setting it to 0.

        The beginning of the buffer is repeated after its end, so that every stretch of a row is
        contiguous.
        """
        cells = memory[base : base + self.size].reshape(self.rows, self.width)
        if len(self.cells):
            cells[:] = self.cells
        elif not empty:
            cells[:] = 0.0
        self.memory, self.base, self.cells = memory, base, cells

    def allocate(self) -> None:
        """Allocate the ring buffer if it has no memory."""
        if not len(self.memory):
            self.move_to(np.zeros(self.size, np.float32), 0, empty=True)

    def append(self, power: NDArray[np.float32]) -> None:
        """Write new columns (rows, columns) into the ring buffer."""
        self.allocate()
        count, cells, length = power.shape[1], self.cells, self.length
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
    def fresh(self) -> int:
        """Number of new columns that have not yet been searched for anchors (strong cells)."""
        return max(0, self.pushed - self.reach - self.columns)

    def advance(self, fresh: int) -> int:
        """Count columns as searched; return the ring buffer position of the first one."""
        first = self.columns % self.length
        self.columns += fresh
        if self.columns > self._first_columns:
            self.threshold = self._steady_threshold
        return first

    def note(self, columns: list[int], rows: list[int], powers: list[float]) -> None:
        """Add anchors to be tested, in the order of their columns."""
        self.anchor_columns += columns
        self.anchor_rows += rows
        self.anchor_powers += powers

    def take_due(self, due: "_Due", member: int) -> None:
        """Append the anchors with complete groups to `due`; `member`: number of this search."""
        columns, tested = self.anchor_columns, self.tested
        if not columns:
            return
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
        due.members += [member] * (len(due.columns) - len(due.members))

    def collect(
        self, tested: "_Tested", part: slice, least: float, shorter: int = 0
    ) -> list[Candidate]:
        """Create candidates from the tested anchors in `part` whose sum is at least `least`."""
        best, level = tested.best[part], tested.level[part]
        cells, power = tested.cells[part], tested.power[part]
        hits = np.flatnonzero(best >= least)
        strengths = (cells[hits].sum(axis=1) + power[hits][:, np.newaxis]) / level[hits][
            :, np.newaxis
        ]
        # Of intervals made equal by the limit, take the one with the most power.
        totals = tested.totals[part][hits] / level[hits][:, np.newaxis]
        strengths[totals < best[hits][:, np.newaxis] - 0.01] = 0.0
        strength = strengths.max(axis=1)
        strongest = np.argsort(-strength)[: GROUPS.candidates_at_once]
        which = hits[strongest]
        interval = self.intervals[strengths.argmax(axis=1)[strongest]] - shorter
        after = np.arange(self.k) - tested.place[part][which][:, np.newaxis]
        columns = tested.column[part][which][:, np.newaxis] + after * interval[:, np.newaxis]
        score, strength, row = best[which], strength[strongest], tested.row[part][which]
        return self._unknown(score, strength, row, columns)

    def candidates(
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
    """Anchors to be tested, in the order of their searches."""

    columns: list[int] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    powers: list[float] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    members: list[int] = field(default_factory=list)


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


def search_together(
    searches: Sequence[AnchorSearch], power: NDArray[np.float32], noise: NDArray[np.float32]
) -> list[list[Candidate]]:
    """Add columns to several searches of equal settings; each one's candidates, best first."""
    if kernels() is not None:
        return [
            _search_by_kernel(search, columns, level)
            for search, columns, level in zip(searches, power, noise, strict=True)
        ]
    found: list[list[Candidate]] = [[] for _ in searches]
    for search, columns in zip(searches, power, strict=True):
        search.append(columns)
    fresh = searches[0].fresh
    if not fresh:
        return found
    _note_anchors(searches, noise)
    due = _Due()
    for member, search in enumerate(searches):
        first = len(due.columns)
        search.take_due(due, member)
        _count_null(search, due, slice(first, None), noise[member], fresh)
    if due.columns:
        _test_all(searches, due, noise, found)
        for some in found:
            best_first(some)
    return found


def _search_by_kernel(
    search: AnchorSearch, power: NDArray[np.float32], level: NDArray[np.float32]
) -> list[Candidate]:
    native = kernels()
    if power.strides[1] != power.itemsize:
        power = np.ascontiguousarray(power)
    search.allocate()
    at, first = search.pushed % search.length, search.columns
    search.pushed += power.shape[1]
    fresh = search.fresh
    begin = search.advance(fresh) if fresh else 0
    ring = (search.memory, search.base, search.rows, search.width, search.length)
    share = search.threshold / search.k
    search.note(*native.note(*ring, at, begin, fresh, first, search.reach, share, level, power))
    due = _Due()
    if fresh:
        search.take_due(due, 0)

    def rated(lows: NDArray[np.intp], least: float, limit: float) -> Any:
        return native.rate(
            *(*ring, search.stretch, search.reach, limit, lows, search.rest, level),
            *(due.columns, due.rows, due.powers, due.places, least),
        )

    null = search.null

    def makes_group(lows: NDArray[np.intp], shorter: int) -> bool:
        assert null is not None
        hits = rated(lows, null.least(search.threshold), null.cell_limit(search.threshold))[1]
        return bool(hits) and bool(search.candidates(due, hits, shorter))

    if fresh and null is not None:
        null.count(fresh, makes_group if due.columns else None)
    if not due.columns:
        return []
    largest, hits = rated(search.lows, search.threshold * search.margin, search.limit)
    search.best = max(search.best, largest / search.threshold)
    if hits and len(due.columns) > GROUPS.anchors_at_once:
        found: list[list[Candidate]] = [[]]
        _test_all([search], due, level[np.newaxis], found)
        return best_first(found[0])
    return best_first(search.candidates(due, hits)) if hits else []


def _count_null(
    search: AnchorSearch, due: _Due, part: slice, level: NDArray[np.float32], fresh: int
) -> None:
    null = search.null
    if null is None:
        return
    column, row = np.array(due.columns[part]), np.array(due.rows[part])
    place, power = np.array(due.places[part]), np.array(due.powers[part], np.float32)

    def makes_group(lows: NDArray[np.intp], shorter: int) -> bool:
        lattice = copy.copy(search)
        lattice.lows, lattice.limit = lows, null.cell_limit(search.threshold)
        member = np.zeros(len(column), np.intp)
        tested = _test([lattice], member, column, row, place, power, level[np.newaxis])
        least = null.least(search.threshold)
        some = bool((tested.best >= least).any())
        return some and bool(search.collect(tested, slice(None), least, shorter))

    null.count(fresh, makes_group if len(column) else None)


def _note_anchors(searches: Sequence[AnchorSearch], noise: NDArray[np.float32]) -> None:
    reach, rows, fresh = searches[0].reach, searches[0].rows, searches[0].fresh
    mask = np.empty((len(searches), rows, fresh), np.bool_)
    places = []
    for search, level, strong in zip(searches, noise, mask, strict=True):
        first = search.columns
        at = search.advance(fresh)
        needed = np.float32(search.threshold / search.k) * level
        np.greater_equal(search.cells[:, at : at + fresh], needed[:, np.newaxis], out=strong)
        places.append((search.base, search.width, search.length, at, first))
    # In one dimension: in two, NumPy visits all cells, at 40 times the cost.
    cells = mask.reshape(-1).nonzero()[0]
    if not len(cells):
        return
    line, column = np.divmod(cells, fresh)
    member, row = np.divmod(line, rows)
    base, width, length, at, first = np.array(places).T[:, member]
    starts = base + row * width + (at + column - reach) % length
    around = _stretches(searches[0].memory, 2 * reach + 1)[starts]
    power = around[:, reach]
    peaks = (power >= around.max(axis=1)).nonzero()[0]
    member = member[peaks]
    order = (member * fresh + column[peaks]).argsort(kind="stable")
    peaks = peaks[order]
    columns, which = (first + column)[peaks].tolist(), row[peaks].tolist()
    powers = power[peaks].tolist()
    upto = 0
    for search, count in zip(searches, np.bincount(member).tolist(), strict=False):
        part = slice(upto, upto + count)
        search.note(columns[part], which[part], powers[part])
        upto += count


def _test_all(
    searches: Sequence[AnchorSearch],
    due: _Due,
    noise: NDArray[np.float32],
    found: list[list[Candidate]],
) -> None:
    member = np.array(due.members)
    column, row = np.array(due.columns), np.array(due.rows)
    place, power = np.array(due.places), np.array(due.powers, np.float32)
    first = 0
    parts: list[tuple[int, slice]] = []
    for index in range(len(searches)):
        last = bisect.bisect_right(due.members, index, first)
        while first < last:
            part = slice(first, min(first + GROUPS.anchors_at_once, last))
            parts.append((index, part))
            first = part.stop
    begin = 0
    for number, (_, part) in enumerate(parts):
        if part.stop - parts[begin][1].start < GROUPS.anchors_at_once and number + 1 < len(
            parts
        ):
            continue
        low = parts[begin][1].start
        some = slice(low, part.stop)
        tested = _test(
            searches, member[some], column[some], row[some], place[some], power[some], noise
        )
        best = tested.best.tolist()
        for index, own in parts[begin : number + 1]:
            search = searches[index]
            own = slice(own.start - low, own.stop - low)
            largest = max(best[own])
            search.best = max(search.best, largest / search.threshold)
            least = search.threshold * search.margin
            if largest >= least:
                found[index] += search.collect(tested, own, least)
        begin = number + 1


def _test(
    searches: Sequence[AnchorSearch],
    member: NDArray[np.intp],
    column: NDArray[np.intp],
    row: NDArray[np.intp],
    place: NDArray[np.intp],
    power: NDArray[np.float32],
    noise: NDArray[np.float32],
) -> _Tested:
    k, reach = searches[0].k, searches[0].reach
    rows = searches[0].rows
    level = noise.reshape(-1)[member * rows + row]
    limit = searches[0].limit
    limits = level * np.float32(limit) if k > 1 else np.full_like(level, np.inf)
    if len(searches) == 1:
        search = searches[0]
        lows, rest, stretch = search.lows[place], search.rest[place], search.stretch
        where = (column[:, np.newaxis] + lows) % search.length
        where += (search.base + row * search.width)[:, np.newaxis]
    else:
        table = member * k + place
        lows = np.concatenate([search.lows for search in searches])[table]
        rest = np.concatenate([search.rest for search in searches])[table]
        stretch = max(search.stretch for search in searches)
        layout = np.array([(s.base, s.width, s.length) for s in searches])
        base, width, length = layout.T[:, member]
        where = (column[:, np.newaxis] + lows) % length[:, np.newaxis]
        where += (base + row * width)[:, np.newaxis]
    largest = _stretches(searches[0].memory, stretch)[where]
    covered = 1
    while covered < 2 * reach + 1:
        shift = min(covered, 2 * reach + 1 - covered)
        largest = np.maximum(largest[..., :-shift], largest[..., shift:])
        covered += shift
    starts = np.arange(where.size) * largest.shape[2]
    rest += starts.reshape(where.shape)[:, :, np.newaxis]
    cells = largest.reshape(-1).take(rest)
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


def _stretches(memory: NDArray[np.float32], length: int) -> NDArray[np.float32]:
    """View of all stretches of `length` contiguous cells of a row, without a copy."""
    return np.ndarray((len(memory) - length + 1, length), np.float32, memory, 0, (4, 4))
