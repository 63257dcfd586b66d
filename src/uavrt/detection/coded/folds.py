"""Sum several bursts to find what no single burst shows.

A seed is a single burst that stands out slightly. It waits until the following bursts have
arrived; then the best sum of three, and of K bursts, that includes it is examined.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.coded.cells import CLIP, STEP, Cells
from uavrt.detection.coded.closely import look
from uavrt.detection.coded.evidence import evidence_of_sums
from uavrt.detection.coded.limits import amplitude_limit, longest, sum_limit
from uavrt.detection.coded.sums import FIELDS, STRETCHES, CodeBook, find_seeds, fold
from uavrt.messages import Tag

_CLIP = 10.0
"""Largest cell that counts [noise energies]: three times that of a tag found only here."""
_SEED_OF_MANY, _SEED_OF_THREE = 3.5, 4.3
"""Mean cell of a seed; three of four sums of bursts at the limit contain one so large, noise
has few."""
_COLUMNS_PER_STEP = 2.0
"""Shift of the last burst from one tried interval to the next [columns]."""
THREE = 3
_EXAMINED_SHARE = 0.88
"""Share of the least sum from which a sum is refined."""
_CLEAR_LEAD = 20.0
"""Least lead of a sum over that of another code with the same pulses."""
_BOX = 2048
"""Range of columns within which due seeds are grouped."""
_AWAY = 10
"""Largest distance between equal pulses of two codes [columns]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Several bursts of a code whose sum exceeds noise.

    `score`: sum of amplitudes over the required one. `also_possible`: ids of other tags that
    may have sent them.
    """

    tag: Tag
    row: int
    columns: NDArray[np.int64]
    energies: NDArray[np.float64]
    score: float
    total: float
    interval: float
    unlisted: float
    """Log-likelihood ratio against unlisted codes that are in step by chance."""
    also_possible: tuple[int, ...] = ()


class Waiting:
    """Seeds that wait for the last burst of their sums.

    They are grouped by due time: only due groups are visited.
    """

    def __init__(self) -> None:
        self._boxes: dict[int, list[NDArray[np.int32]]] = {}
        self._calls = 0

    def add(self, seeds: NDArray[np.int32], ends: NDArray[np.float64]) -> None:
        """Add seeds, each with the column at which it is due."""
        self._calls += 1
        columns = np.floor(ends).astype(np.int32)
        call = np.full(len(seeds), self._calls, np.int32)
        entries = np.concatenate((call[:, None], columns[:, None], seeds), axis=1)
        boxes = columns // _BOX
        order = np.argsort(boxes, kind="stable")
        found, first = np.unique(boxes[order], return_index=True)
        for box, own in zip(found.tolist(), np.split(order, first[1:]), strict=False):
            self._boxes.setdefault(box, []).append(entries[own])

    def due(self, before: float) -> NDArray[np.int32]:
        """Remove and return the seeds due before a column, in the order of arrival."""
        taken = [np.zeros((0, 2 + FIELDS), np.int32)]
        for box in [one for one in self._boxes if one * _BOX < before]:
            entries = np.concatenate(self._boxes.pop(box))
            over = entries[:, 1] < before
            taken.append(entries[over])
            if not over.all():
                self._boxes[box] = [entries[~over]]
        entries = np.concatenate(taken)
        call, _, code, row, _, column, _ = entries.T
        return np.ascontiguousarray(entries[np.lexsort((column, row, code, call)), 2:])


class Folds:
    """Seeds of the codes with equal numbers of pulses, and their results.

    `kept_s`: duration for which cells are kept.
    """

    def __init__(
        self,
        book: CodeBook,
        cells: Cells,
        *,
        kept_s: float,
        bandwidth_hz: float,
        false_per_hour: float,
    ) -> None:
        self._book, self._cells = book, cells
        self._false_per_hour = false_per_hour
        self._bandwidth_hz = bandwidth_hz
        self._bursts = np.array([longest(tag, kept_s) for tag in book.tags])
        self._error = np.array([t.interval_uncertainty_s for t in book.tags]) / cells.column_s
        most = 255 // book.pulses
        self._clip = min(round(_CLIP / STEP), most)
        self._clip_of_three = min(CLIP, most)
        self._least_of: dict[int, NDArray[np.float64]] = {}
        self._waiting = {
            bursts: Waiting()
            for bursts in sorted({THREE, *self._bursts.tolist()})
            if bursts >= THREE
        }

    def note(self, first: int, count: int) -> None:
        """Find seeds among bursts that begin at some columns."""
        pulses = self._book.pulses
        seeds = find_seeds(
            *(self._cells, self._book, first, count),
            clip=self._clip,
            level=round(_SEED_OF_MANY * pulses / STEP),
        )
        most = self._bursts[seeds[:, 0]]
        for bursts, waiting in self._waiting.items():
            own = seeds[most == bursts] if bursts != THREE else seeds[most >= THREE]
            if bursts == THREE:
                own = own[own[:, 4] >= round(_SEED_OF_THREE * pulses / STEP)]
            reach = self._error[own[:, 0]] + self._book.intervals[own[:, 0]]
            ends = own[:, 3] + (bursts - 1) * reach + self._book.span + self._cells.pulse
            waiting.add(own, ends)

    def complete(self, whole: int, *, foreign_per_hour: float, last: bool) -> list[Found]:
        """Sum around the seeds whose later bursts have all arrived.

        `whole`: column before which bursts are complete.
        """
        hits: list[Found] = []
        for bursts, waiting in self._waiting.items():
            seeds = waiting.due(math.inf if last else whole)
            for error in np.unique(self._error[seeds[:, 0]]):
                own = seeds[self._error[seeds[:, 0]] == error]
                hits += self._hits(own, bursts, error, foreign_per_hour)
        return self._apart(hits)

    def _hits(
        self, seeds: NDArray[np.int32], bursts: int, error: float, foreign_per_hour: float
    ) -> list[Found]:
        steps = math.ceil((bursts - 1) * error / _COLUMNS_PER_STEP)
        best = fold(
            *(self._cells, self._book, seeds),
            bursts=bursts,
            reach=error,
            steps=steps,
            clip=self._clip_of(bursts),
        )
        found = []
        nearly = _EXAMINED_SHARE * self._least(bursts)[seeds[:, 0]]
        enough = best[:, 0] * STEP >= nearly
        for seed, one in zip(seeds[enough].tolist(), best[enough].tolist(), strict=True):
            off = error * one[1] / max(steps, 1)
            found.append(self._found(seed, one[2], off, bursts, foreign_per_hour))
        return [one for one in found if one.score >= 1.0 and self._steady(one)]

    def _clip_of(self, bursts: int) -> int:
        """Largest cell that counts; pulses visible in three bursts are stronger."""
        return self._clip_of_three if bursts == THREE else self._clip

    def _least(self, bursts: int) -> NDArray[np.float64]:
        if bursts not in self._least_of:
            limits = [
                sum_limit(
                    tag,
                    bandwidth_hz=self._bandwidth_hz,
                    bursts=bursts,
                    pulses=bursts * self._book.pulses,
                    false_per_hour=self._false_per_hour,
                )
                for tag in self._book.tags
            ]
            self._least_of[bursts] = np.array(limits)
        return self._least_of[bursts]

    def _found(
        self, seed: list[int], first: int, off: float, bursts: int, foreign_per_hour: float
    ) -> Found:
        code, row, stretch, column, _ = seed
        interval = float(self._book.intervals[code])
        interval_s = interval * self._cells.column_s
        places = np.arange(first, first + bursts)
        begins = column + np.floor(places * interval + 0.5) + np.floor(places * off + 0.5)
        closely = look(
            *(self._cells, self._book.tags[code]),
            row=row,
            part=STRETCHES[stretch],
            begins=begins,
            most=self._clip_of(bursts) * STEP,
        )
        energies = np.minimum(closely.energies, self._clip_of(bursts) * STEP)
        (unlisted,) = evidence_of_sums(
            energies[None],
            foreign_per_hour=foreign_per_hour,
            in_step=2.0 * (self._error[code] * self._cells.column_s + 1e-3) / interval_s,
        )
        least = amplitude_limit(
            self._book.tags[code],
            bandwidth_hz=self._bandwidth_hz,
            bursts=bursts,
            pulses=energies.size,
            false_per_hour=self._false_per_hour,
        )
        return Found(
            tag=self._book.tags[code],
            row=row,
            columns=np.rint(closely.columns).astype(np.int64),
            energies=energies,
            score=float(np.sqrt(energies).sum()) / least,
            total=float(energies.sum()),
            interval=interval + off,
            unlisted=float(unlisted),
        )

    def _steady(self, one: Found) -> bool:
        """True if no single burst makes the sum: each counts at most 1.6 times the median."""
        sums = np.sqrt(one.energies).sum(axis=1)
        limited = np.minimum(sums, 1.6 * np.median(sums))
        return bool(limited.sum() >= 0.965 * sums.sum() / max(one.score, 1.0))

    def _apart(self, hits: list[Found]) -> list[Found]:
        """Select the best of hits with common pulses, and name those nearly as good."""
        chosen: list[Found] = []
        for one in sorted(hits, key=lambda hit: -hit.score):
            shared = [
                place
                for place, other in enumerate(chosen)
                if _common(one.columns, other.columns) > 0.25
            ]
            if not shared:
                chosen.append(one)
                continue
            for place in shared:
                other = chosen[place]
                near = one.energies.shape == other.energies.shape and (
                    one.total > other.total - _CLEAR_LEAD
                )
                if near and one.tag.tag_id not in (other.tag.tag_id, *other.also_possible):
                    chosen[place] = _with_rival(other, one.tag.tag_id)
        return chosen


def _common(one: NDArray[np.int64], other: NDArray[np.int64]) -> float:
    """Share of one's pulses that are also the other's."""
    apart = np.abs(one.reshape(-1, 1) - other.reshape(1, -1))
    return float((apart <= _AWAY).any(axis=1).mean())


def _with_rival(found: Found, tag_id: int) -> Found:
    return replace(found, also_possible=(*found.also_possible, tag_id))
