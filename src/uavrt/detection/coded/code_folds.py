"""Sum several bursts of a code, to detect bursts that are too weak one by one.

A seed, a burst slightly above the noise, is stored until the following bursts have arrived.
Then the largest sums of three and of K bursts that include it are tested.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.coded.code_evidence import evidence_of_sums
from uavrt.detection.coded.limits import amplitude_limit, longest, sum_limit
from uavrt.detection.coded.refinement import refine
from uavrt.detection.coded.slot_cells import CLIP, STEP, Cells
from uavrt.detection.coded.sums import FIELDS, CodeBook, find_seeds, fold
from uavrt.detection.coded.tuning import SUMS


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Several bursts of one code whose sum is above the noise.

    `score`: sum of amplitudes divided by the required sum. `also_possible`: ids of other tags
    that may have sent the bursts.
    """

    tag: Tag
    row: int
    columns: NDArray[np.int64]
    energies: NDArray[np.float64]
    score: float
    total: float
    interval: float
    unlisted: float
    """Log-likelihood ratio of the listed code to an unlisted code that has its interval by
    chance."""
    also_possible: tuple[int, ...] = ()


class Waiting:
    """Weak bursts (seeds), grouped by the time at which their sums can be computed."""

    def __init__(self) -> None:
        self._boxes: dict[int, list[NDArray[np.int32]]] = {}
        self._calls = 0

    def add(self, seeds: NDArray[np.int32], ends: NDArray[np.float64]) -> None:
        """Add seeds, each with the column at which its sum can be computed."""
        self._calls += 1
        columns = np.floor(ends).astype(np.int32)
        call = np.full(len(seeds), self._calls, np.int32)
        entries = np.concatenate((call[:, None], columns[:, None], seeds), axis=1)
        boxes = columns // SUMS.box_columns
        order = np.argsort(boxes, kind="stable")
        found, first = np.unique(boxes[order], return_index=True)
        for box, own in zip(found.tolist(), np.split(order, first[1:]), strict=False):
            self._boxes.setdefault(box, []).append(entries[own])

    def due(self, before: float) -> NDArray[np.int32]:
        """Remove and return the seeds due before a column, in the order of arrival."""
        taken = [np.zeros((0, 2 + FIELDS), np.int32)]
        for box in [one for one in self._boxes if one * SUMS.box_columns < before]:
            entries = np.concatenate(self._boxes.pop(box))
            over = entries[:, 1] < before
            taken.append(entries[over])
            if not over.all():
                self._boxes[box] = [entries[~over]]
        entries = np.concatenate(taken)
        call, _, code, row, _, column, _ = entries.T
        return np.ascontiguousarray(entries[np.lexsort((column, row, code, call)), 2:])


class Folds:
    """Sums several bursts of codes with equal numbers of pulses, in `kept_s` of cells."""

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
        self._clip = min(round(SUMS.most_cell / STEP), most)
        self._clip_of_three = min(CLIP, most)
        self._least_of: dict[int, NDArray[np.float64]] = {}
        self._waiting = {
            bursts: Waiting()
            for bursts in sorted({SUMS.few_bursts, *self._bursts.tolist()})
            if bursts >= SUMS.few_bursts
        }

    def note(self, first: int, count: int) -> None:
        """Find single bursts above a low level (seeds); store them until sums are due."""
        pulses = self._book.pulses
        seeds = find_seeds(
            *(self._cells, self._book, first, count),
            clip=self._clip,
            level=round(SUMS.seed_of_many * pulses / STEP),
        )
        most = self._bursts[seeds[:, 0]]
        for bursts, waiting in self._waiting.items():
            own = (
                seeds[most == bursts]
                if bursts != SUMS.few_bursts
                else seeds[most >= SUMS.few_bursts]
            )
            if bursts == SUMS.few_bursts:
                own = own[own[:, 4] >= round(SUMS.seed_of_three * pulses / STEP)]
            reach = self._error[own[:, 0]] + self._book.intervals[own[:, 0]]
            ends = own[:, 3] + (bursts - 1) * reach + self._book.span + self._cells.pulse
            waiting.add(own, ends)

    def complete(self, whole: int, *, foreign_per_hour: float, last: bool) -> list[Found]:
        """Compute the sums around seeds, where all bursts came before column `whole`."""
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
        steps = math.ceil((bursts - 1) * error / SUMS.columns_per_step)
        best = fold(
            *(self._cells, self._book, seeds),
            bursts=bursts,
            reach=error,
            steps=steps,
            clip=self._clip_of(bursts),
        )
        found = []
        nearly = SUMS.examined_share * self._least(bursts)[seeds[:, 0]]
        enough = best[:, 0] * STEP >= nearly
        for seed, one in zip(seeds[enough].tolist(), best[enough].tolist(), strict=True):
            off = error * one[1] / max(steps, 1)
            found.append(self._found(seed, one[2], off, bursts, foreign_per_hour))
        return [one for one in found if one.score >= 1.0 and self._steady(one)]

    def _clip_of(self, bursts: int) -> int:
        return self._clip_of_three if bursts == SUMS.few_bursts else self._clip

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
        refined = refine(
            *(self._cells, self._book.tags[code]),
            row=row,
            part=SUMS.stretches[stretch],
            begins=begins,
            most=self._clip_of(bursts) * STEP,
        )
        energies = np.minimum(refined.energies, self._clip_of(bursts) * STEP)
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
            columns=np.rint(refined.columns).astype(np.int64),
            energies=energies,
            score=float(np.sqrt(energies).sum()) / least,
            total=float(energies.sum()),
            interval=interval + off,
            unlisted=float(unlisted),
        )

    def _steady(self, one: Found) -> bool:
        """True if no single burst dominates the sum: none exceeds 1.6 times the median."""
        sums = np.sqrt(one.energies).sum(axis=1)
        limited = np.minimum(sums, 1.6 * np.median(sums))
        return bool(limited.sum() >= 0.965 * sums.sum() / max(one.score, 1.0))

    def _apart(self, hits: list[Found]) -> list[Found]:
        """Choose the best of sums that share pulses; note the tags of nearly equal sums."""
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
                    one.total > other.total - SUMS.clear_lead
                )
                known = (other.tag.tag_id, *other.also_possible)
                if near and one.tag.tag_id not in known:
                    also = (*other.also_possible, one.tag.tag_id)
                    chosen[place] = replace(other, also_possible=also)
        return chosen


def _common(one: NDArray[np.int64], other: NDArray[np.int64]) -> float:
    apart = np.abs(one.reshape(-1, 1) - other.reshape(1, -1))
    return float((apart <= SUMS.same_columns).any(axis=1).mean())
