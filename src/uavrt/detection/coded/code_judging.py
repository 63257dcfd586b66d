"""Decide whether a sum of cells is a burst, and which of several codes sent it.

A burst comes from one tag within a quarter of a second: its pulses are equally strong, short,
and at the maximum of their signal. A stronger burst explains all signals during its pulses.
Pulses that only one of two codes has distinguish the codes.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from uavrt.detection.coded.code_evidence import evidence
from uavrt.detection.coded.slot_cells import Cells
from uavrt.detection.coded.sums import CodeBook
from uavrt.detection.coded.tuning import LIKELIHOOD, SHAPE


@dataclass(slots=True, kw_only=True)
class Burst:
    """A possible burst of one code.

    `column`: approximate column of the first pulse. `offsets` (pulses,): columns from the first
    pulse to each pulse, by the code. `columns` (pulses,): columns with the largest cell of each
    pulse. `good` (pulses,): True for pulses that are undisturbed and equally strong.
    `likelihood`: log-likelihood ratio of the burst to noise.
    """

    book: CodeBook
    code: int
    row: int
    stretch: int
    column: int
    offsets: NDArray[np.int32]
    columns: NDArray[np.intp]
    energies: NDArray[np.float64]
    good: NDArray[np.bool_]
    likelihood: float = 0.0
    unlisted: float = 0.0
    """Log-likelihood ratio of the listed code to unlisted codes."""
    alone: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    """(pulses,) log-likelihood ratio of each pulse to noise or to a pulse of another burst."""
    prior: float = 0.0
    """Log odds that the tag sends a burst at this time and not at any other time."""
    score: float = 0.0
    """Ratio of the summed energy of the burst's pulses to the sum required for a detection."""
    also_possible: list[int] = field(default_factory=list)
    """Ids of other tags that may have sent the burst."""
    hit_by: list[int] = field(default_factory=list)
    """Ids of tags with bursts that overlap too many pulses of this burst."""

    @property
    def tag_id(self) -> int:
        """Id of the tag that has this burst's code."""
        return self.book.tags[self.code].tag_id


def measure(
    cells: Cells,
    book: CodeBook,
    seeds: NDArray[np.int32],
    limits: dict[int, float],
    foreign_per_hour: float,
    *,
    prior: float = 0.0,
) -> list[Burst]:
    """Measure possible bursts (seeds) in the recent cells and drop what is not a burst."""
    if not len(seeds):
        return []
    seeds = _centred(cells, book, seeds)
    offsets = _finely(cells, book, seeds)
    last = cells.recent.shape[1] - 1
    at = seeds[:, 3:4] + offsets - cells.recent_from
    # Only cells exactly at the gaps count; each further column would add a chance match.
    energies = cells.recent[seeds[:, 1][:, None], np.clip(at, 0, last)]
    able = np.flatnonzero(may_suffice(energies, limits))
    seeds, offsets, at, energies = seeds[able], offsets[able], at[able], energies[able]
    rows = seeds[:, 1][:, None]
    off_place, highest = _off_place(cells, rows, at)
    near, shift = _best(cells.recent, rows, at, SHAPE.pool_columns)
    at = at + shift
    tall = np.maximum(
        _best(cells.recent, rows, at, cells.pulse)[0],
        np.maximum(
            cells.recent[np.maximum(rows - 1, 0), at],
            cells.recent[np.minimum(rows + 1, len(cells.recent) - 1), at],
        ),
    )
    amplitude = np.sqrt(energies)
    # A pulse ends on both sides; older tags send pulses up to three times as long as usual.
    far = np.rint(np.array(SHAPE.end_widths) * cells.pulse).astype(np.intp)[:, None, None]
    before = cells.recent[rows, np.maximum(at - far, 0)].min(axis=0)
    after = cells.recent[rows, np.minimum(at + far, last)].min(axis=0)
    around = np.sqrt(np.maximum(before, after))
    good = np.sqrt(tall) <= amplitude * (1.0 + LIKELIHOOD.fading) + SHAPE.higher_amplitude
    good &= around <= SHAPE.beside_amplitude * amplitude + SHAPE.higher_amplitude
    off_place &= amplitude < SHAPE.flank_amplitude * np.sqrt(highest)
    good &= ~off_place
    # A much stronger signal at another frequency leaks into all rows.
    everywhere = sliding_window_view(
        np.pad(cells.recent.max(axis=0), cells.pulse), 2 * cells.pulse + 1
    )
    loudest = everywhere[np.clip(at, 0, last)].max(axis=2)
    good &= (amplitude >= SHAPE.leak_amplitude * np.sqrt(loudest)) | (
        loudest < SHAPE.loud_energy
    )
    found = []
    enough = good.sum(axis=1) >= least_pulses(book.pulses)
    usual = _median(amplitude, good)[:, np.newaxis]
    # If no signal could hide the pulse, the pulse is missing.
    enough &= ~((np.sqrt(near) < SHAPE.hit_amplitude * usual) & ~good).any(axis=1)
    # A pulse off its position and as strong as the others means another code. Flanks of two
    # pulses, without pulses at the other positions, are no burst either.
    tops = np.sqrt(highest)
    usual = _median(tops, good)[:, np.newaxis]
    alike = np.abs(tops - usual) <= 3.0 * LIKELIHOOD.fading * tops + SHAPE.higher_amplitude
    enough &= ~((off_place & alike) | (good & (tops < SHAPE.hit_amplitude * usual))).any(axis=1)
    for i in np.flatnonzero(enough).tolist():
        seed = seeds[i].tolist()
        burst = Burst(
            book=book,
            code=seed[0],
            row=seed[1],
            stretch=seed[2],
            column=seed[3],
            offsets=offsets[i],
            columns=at[i] + cells.recent_from,
            energies=energies[i].astype(np.float64),
            good=good[i].copy(),
            prior=prior,
        )
        found.append(burst)
    return weigh(found, limits, foreign_per_hour)


def _centred(cells: Cells, book: CodeBook, seeds: NDArray[np.int32]) -> NDArray[np.int32]:
    """Move each strong possible burst to the start and gap stretch with the largest sum."""
    offsets = book.offsets[seeds[:, 0]]
    last = cells.recent.shape[1] - 1
    at = seeds[:, 3] - cells.recent_from
    here = cells.recent[seeds[:, 1, None], np.clip(at[:, None] + offsets[:, 0], 0, last)]
    strong = np.flatnonzero(here.max(axis=1) >= SHAPE.saturated_energy)
    if not len(strong):
        return seeds
    shifts = np.arange(-cells.pulse, cells.pulse + 1)
    margin = cells.pulse + int(np.ptp(book.offsets, axis=1).max())
    root = np.pad(np.sqrt(cells.recent), ((0, 0), (margin, margin)), mode="edge")
    first = seeds[strong, 1].astype(np.intp) * root.shape[1] + at[strong] + margin
    windows = sliding_window_view(root.ravel(), len(shifts))
    amplitude = np.zeros((len(strong), offsets.shape[1], len(shifts)), np.float32)
    for pulse in range(book.pulses):
        amplitude += windows[first[:, np.newaxis] + offsets[strong, :, pulse] - cells.pulse]
    best = amplitude.reshape(len(strong), -1).argmax(axis=1)
    moved = seeds.copy()
    moved[strong, 2] = best // len(shifts)
    moved[strong, 3] += shifts[best % len(shifts)].astype(np.int32)
    key = np.zeros(len(moved), np.int64)
    for field_ in moved[:, :4].T:
        low, high = int(field_.min()), int(field_.max())
        key = key * (high - low + 1) + (field_ - low)
    _, first = np.unique(key, return_index=True)
    return moved[first]


def _finely(cells: Cells, book: CodeBook, seeds: NDArray[np.int32]) -> NDArray[np.int32]:
    """(n, pulses) offsets from a burst's start at which the pulses are strongest [columns]."""
    shifts = np.array([0, -1, 1], np.int32)
    tried = book.fine[seeds[:, 0], seeds[:, 2]][:, None] + shifts[:, None, None]
    tried = tried.reshape(len(seeds), -1, book.pulses)
    at = tried + (seeds[:, 3] - cells.recent_from)[:, None, None]
    at = np.clip(at, 0, cells.recent.shape[1] - 1)
    sums = cells.recent[seeds[:, 1][:, None, None], at].sum(axis=2)
    best: NDArray[np.int32] = tried[np.arange(len(seeds)), sums.argmax(axis=1)]
    return best


def _off_place(
    cells: Cells, rows: NDArray[np.int32], at: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """(n, pulses) True for pulses that are displaced in their burst; and the pulses' energies.

    An energy is the maximum within a pulse width and over adjacent frequencies, because only
    the strongest row shows the true position.
    """
    around = cells.recent.copy()
    for apart in range(1, cells.rows_of_a_bin + 1):
        np.maximum(around[apart:], cells.recent[:-apart], out=around[apart:])
        np.maximum(around[:-apart], cells.recent[apart:], out=around[:-apart])
    highest, shift = _best(around, rows, at, cells.pulse)
    allowed_s = SHAPE.aside_s + SHAPE.aside_noise_s / np.sqrt(np.maximum(highest, 1.0))
    usual = np.median(shift, axis=1, keepdims=True)
    return np.abs(shift - usual) * cells.column_s > allowed_s, highest


def _best(
    recent: NDArray[np.float32], rows: NDArray[np.int32], at: NDArray[np.intp], reach: int
) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    padded = np.pad(recent, ((0, 0), (reach, reach)), mode="edge")
    columns = np.clip(at, 0, recent.shape[1] - 1)
    windows = sliding_window_view(padded.ravel(), 2 * reach + 1)
    near = windows[rows.astype(np.intp) * padded.shape[1] + columns]
    which = near.argmax(axis=2)
    best = np.take_along_axis(near, which[:, :, None], axis=2)[:, :, 0]
    return best, which - reach


def least_pulses(pulses: int) -> int:
    """Minimum number of undisturbed pulses in a burst: all but two, and at least three (all, if
    the burst has fewer).
    """
    return max(min(3, pulses), pulses - 1) if pulses <= 4 else pulses - 2


def _median(values: NDArray[np.floating[Any]], of: NDArray[np.bool_]) -> NDArray[np.float64]:
    ordered = np.sort(np.where(of, values, np.inf).astype(np.float64), axis=1)
    count = of.sum(axis=1)
    rows = np.arange(len(ordered))
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    high = np.minimum(high, ordered.shape[1] - 1)
    return np.asarray(0.5 * (ordered[rows, low] + ordered[rows, high]))


def weigh(
    bursts: list[Burst], limits: dict[int, float], foreign_per_hour: float
) -> list[Burst]:
    """Compute scores of bursts with equal numbers of pulses; drop those that are too weak."""
    if not bursts:
        return []
    energies = np.stack([one.energies for one in bursts])
    good = np.stack([one.good for one in bursts])
    found = evidence(energies, good, foreign_per_hour=foreign_per_hour)
    scores = scores_of(energies, found.own, limits)
    for i, burst in enumerate(bursts):
        burst.good, burst.score = found.own[i], float(scores[i])
        burst.unlisted, burst.alone = float(found.over_unlisted[i]), found.alone[i]
        burst.likelihood = float(found.over_noise[i]) + burst.prior
    return [
        one
        for one in bursts
        if one.score >= 1.0 and one.unlisted + one.prior >= LIKELIHOOD.least_log
    ]


def scores_of(
    energies: NDArray[np.float64], own: NDArray[np.bool_], limits: dict[int, float]
) -> NDArray[np.float64]:
    """Ratio of the sum of each burst's undisturbed pulses to the required sum; 0 if too few."""
    least = np.array([limits.get(count, np.inf) for count in range(own.shape[1] + 1)])
    limit = least[own.sum(axis=1)][:, None]
    # A pulse that is much stronger than the others is not representative of them.
    counted = np.minimum(np.where(own, energies, 0.0), 0.5 * limit)
    return np.asarray((counted / limit).sum(axis=1))


def may_suffice(energies: NDArray[np.float32], limits: dict[int, float]) -> NDArray[np.bool_]:
    """(n,) True for seeds with enough energy, in all or some pulses, for the required sum."""
    pulses = energies.shape[1]
    ordered = -np.sort(-energies.astype(np.float64), axis=1)
    able = np.zeros(len(energies), np.bool_)
    for count, limit in limits.items():
        able |= np.minimum(ordered[:, :count], 0.5 * limit).sum(axis=1) >= SHAPE.rounded * limit
    # Most seeds are one or two pulses: test the required number of the most equal ones.
    least = least_pulses(pulses)
    able &= ordered[:, least - 1] >= SHAPE.least_amplitude**2 * ordered[:, pulses - least]
    return able


class AcceptedBursts:
    """Bursts of a channel that were accepted; they explain the signals during their pulses."""

    def __init__(self, cells: Cells) -> None:
        self.guard = cells.pulse + round(SHAPE.guard_s / cells.column_s)
        """Number of spectrogram columns on either side of a pulse that belong to it."""
        self.bursts: list[Burst] = []
        self._cells = cells

    def drop_before(self, before: int) -> None:
        """Drop the bursts that ended before a column."""
        self.bursts = [one for one in self.bursts if one.columns[-1] >= before]


class Overlaps:
    """Finds pulses of possible bursts that accepted bursts overlap, and those that remain."""

    def __init__(self, claims: list[Burst], guard: int) -> None:
        shape = len(claims), max((len(one.columns) for one in claims), default=0)
        self._guard = guard
        self._columns = np.full(shape, SHAPE.nowhere, np.intp)
        self._energies = np.zeros(shape)
        self._good = np.zeros(shape, np.bool_)
        for pulses in {len(one.columns) for one in claims}:
            own = [i for i, one in enumerate(claims) if len(one.columns) == pulses]
            self._columns[own, :pulses] = [claims[i].columns for i in own]
            self._energies[own, :pulses] = [claims[i].energies for i in own]
            self._good[own, :pulses] = [claims[i].good for i in own]
        self._least = [least_pulses(len(one.columns)) for one in claims]
        self.pulses = np.zeros(shape, np.bool_)
        """(possible bursts, pulses) True for pulses that overlap with accepted bursts."""
        self._by: list[tuple[Burst, NDArray[np.bool_]]] = []
        self._accepted: dict[int, list[Burst]] = {}
        self._sum()

    def add(self, *bursts: Burst) -> None:
        """Add accepted bursts; count the pulses of each possible burst that they overlap."""
        for burst in bursts:
            apart = np.abs(self._columns[:, :, None] - burst.columns)
            hit = (apart <= self._guard).any(axis=2)
            self.pulses |= hit
            self._by.append((burst, hit.any(axis=1)))
            self._accepted.setdefault(burst.tag_id, []).append(burst)
        self._sum()

    def _sum(self) -> None:
        alone = self._good & ~self.pulses
        self.count: list[int] = self.pulses.sum(axis=1).tolist()
        """(possible bursts,) number of pulses that overlap with accepted bursts."""
        self.alone: list[int] = alone.sum(axis=1).tolist()
        """(possible bursts,) number of good pulses that overlap with no accepted burst."""
        self.weakest: list[float] = (
            np.where(alone, self._energies, np.inf).min(axis=1, initial=np.inf).tolist()
        )

    def too_few_left(self, claim: int) -> bool:
        """True if overlaps leave a possible burst, by its index, too few pulses to report
        it.
        """
        alone = self.alone[claim]
        return alone < self._least[claim] and (
            alone < SHAPE.sure_pulses or self.weakest[claim] < SHAPE.sure_energy
        )

    def overlapped_by(self, claim: int) -> list[Burst]:
        """Accepted bursts that overlap pulses of a possible burst, given by its index."""
        return [burst for burst, hit in self._by if hit[claim]]

    def is_sending(self, burst: Burst) -> bool:
        """True if the tag of a burst already has an accepted burst at the same time."""
        own = self._accepted.get(burst.tag_id)
        if own is None:
            return False
        length = int(burst.columns[-1] - burst.columns[0])
        return any(abs(one.column - burst.column) <= length for one in own)


def decide(
    claims: list[Burst],
    accepted_bursts: AcceptedBursts,
    limits: dict[int, dict[int, float]],
    *,
    before: int,
    foreign_per_hour: float,
) -> tuple[list[Burst], int]:
    """Choose the bursts that together explain the pulses best; count bursts lost by overlap.

    The likeliest burst is accepted first. Then each accepted burst is removed as a test, to see
    whether others explain more pulses: a third code may share pulses with two interleaved
    bursts. Only losses before column `before` are counted.
    """
    without: frozenset[int] = frozenset()
    best, lost = _greedy(claims, accepted_bursts, limits, before, foreign_per_hour, without)
    for _ in range(SHAPE.most_swaps):
        collided = [
            one for one in best if not one.good.all() or one.also_possible or one.hit_by
        ]
        around = {one.tag_id for one in best if any(_meet(one, hit) for hit in collided)}
        others = []
        for tag_id in around:
            tried = without | {tag_id}
            found = _greedy(claims, accepted_bursts, limits, before, foreign_per_hour, tried)
            others.append((*found, tried))
        better = max(others, key=lambda one: _total(one[0]), default=None)
        if better is None or _total(better[0]) <= _total(best):
            break
        best, lost, without = better
    return best, lost


def _total(bursts: list[Burst]) -> float:
    return sum(one.likelihood for one in bursts)


def _meet(one: Burst, other: Burst) -> bool:
    return bool(one.columns[0] <= other.columns[-1] and other.columns[0] <= one.columns[-1])


def _greedy(
    claims: list[Burst],
    before_now: AcceptedBursts,
    limits: dict[int, dict[int, float]],
    before: int,
    foreign_per_hour: float,
    without: frozenset[int],
) -> tuple[list[Burst], int]:
    ordered = [one for one in claims if one.tag_id not in without]
    ordered.sort(key=lambda one: -one.likelihood)
    covered = Overlaps(ordered, before_now.guard)
    covered.add(*before_now.bursts)
    accepted: list[Burst] = []
    lost = 0
    for i, claim in enumerate(ordered):
        if covered.is_sending(claim):
            continue
        if covered.count[i]:
            pulses = len(claim.columns)
            for other in covered.overlapped_by(i) if covered.count[i] >= pulses - 1 else ():
                near = claim.likelihood > other.likelihood - SHAPE.clear_log
                if near and claim.tag_id not in other.also_possible:
                    other.also_possible.append(claim.tag_id)
            if covered.too_few_left(i):
                lost += covered.alone[i] > 0 and claim.column < before
                continue
        burst = replace(claim, good=claim.good.copy(), also_possible=[])
        if covered.count[i]:
            burst.good &= ~covered.pulses[i, :pulses]
            if not weigh([burst], limits[pulses], foreign_per_hour):
                alone = burst.energies[burst.good]
                lost += len(alone) > 0 and burst.column < before
                if len(alone) < SHAPE.sure_pulses or alone.min() < SHAPE.sure_energy:
                    continue
                # Too many pulses overlap: name the overlapping tag, which others may not use.
                burst.hit_by += [other.tag_id for other in covered.overlapped_by(i)]
        accepted.append(burst)
        covered.add(burst)
    return accepted, lost
