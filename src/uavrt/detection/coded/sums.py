"""Add the cells of pulses at the gaps of many codes, to search for all codes of a channel.

An error of the tag's crystal stretches all gaps by one factor, so a few factors are tried. Sums
of several bursts are computed around a seed, a burst whose own sum is above usual noise, at
multiples of the burst interval.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.config.tags.code_rules import GAP_TOLERANCE_S
from uavrt.core.messages import Tag
from uavrt.core.runtime.native import kernels
from uavrt.detection.coded.slot_cells import Cells
from uavrt.detection.coded.tuning import SUMS

FIELDS = 5
"""Number of values that describe a possible burst: code, row, stretch, column, sum."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeBook:
    """Codes with equal numbers of pulses; all times are in columns of cells.

    `offsets` (codes, stretches, pulses): columns of the pulses after the first. `fine` (codes,
    stretches, 3, pulses): the same for a slightly smaller, the exact and a slightly larger
    stretch. `intervals` (codes,): burst intervals.
    """

    tags: tuple[Tag, ...]
    offsets: NDArray[np.int32]
    fine: NDArray[np.int32]
    intervals: NDArray[np.float32]

    @property
    def pulses(self) -> int:
        """Number of pulses in a burst."""
        return int(self.offsets.shape[2])

    @property
    def span(self) -> int:
        """Number of columns from the first to the last pulse of the longest burst."""
        return int(self.offsets.max())


def make_code_book(tags: tuple[Tag, ...], column_s: float) -> CodeBook:
    """Create the code book of tags whose codes have equal numbers of gaps."""
    gaps_s = np.array([tag.gaps_s for tag in tags])
    starts_s = np.concatenate((np.zeros((len(tags), 1)), np.cumsum(gaps_s, axis=1)), axis=1)
    stretches = np.add.outer(np.array(SUMS.stretches), (-0.25, 0.0, 0.25))
    parts = GAP_TOLERANCE_S * stretches / starts_s[:, -1, None, None]
    fine = np.rint(starts_s[:, None, None, :] * (1.0 + parts[..., None]) / column_s)
    return CodeBook(
        tags=tags,
        offsets=np.ascontiguousarray(fine[:, :, 1], np.int32),
        fine=fine.astype(np.int32),
        intervals=np.array([tag.pulse_intervals_s[0] / column_s for tag in tags], np.float32),
    )


def find_seeds(
    cells: Cells, book: CodeBook, first: int, count: int, *, clip: int, level: int
) -> NDArray[np.int32]:
    """Find sums of cells of at least `level`: (n, 5) code, row, stretch, column, sum."""
    at = first - cells.base
    if at < SUMS.apart_columns:
        count, at = count - (SUMS.apart_columns - at), SUMS.apart_columns
    if count <= 0:
        return np.zeros((0, FIELDS), np.int32)
    rows, width = cells.kept.shape
    native = kernels()
    if native is None:
        found = _seeds_in_numpy(cells.kept, book, at, count, clip, level)
    else:
        codes, stretches, pulses = book.offsets.shape
        raw = native.seeds(
            *(cells.kept, rows, width, at, count, book.offsets, codes, stretches, pulses),
            *(clip, level, SUMS.apart_columns),
        )
        found = np.frombuffer(raw, np.int32).reshape(-1, FIELDS).copy()
    found[:, 3] += cells.base
    return found


def _seeds_in_numpy(
    kept: NDArray[np.uint8], book: CodeBook, at: int, count: int, clip: int, level: int
) -> NDArray[np.int32]:
    limited = np.minimum(kept, clip)
    found = [np.zeros((0, FIELDS), np.int32)]
    begin, length = at - SUMS.apart_columns, count + 2 * SUMS.apart_columns
    for code, offsets in enumerate(book.offsets):
        sums = np.stack(
            [
                sum(limited[:, begin + o : begin + o + length] for o in own)
                for own in offsets.tolist()
            ]
        )
        best = sums.max(axis=0)
        inner = best[:, SUMS.apart_columns : -SUMS.apart_columns]
        top = inner >= level
        for k in range(1, SUMS.apart_columns + 1):
            top &= best[:, SUMS.apart_columns - k : SUMS.apart_columns - k + count] < inner
            top &= best[:, SUMS.apart_columns + k : SUMS.apart_columns + k + count] <= inner
        row, column = np.nonzero(top)
        which = sums[:, row, column + SUMS.apart_columns].argmax(axis=0)
        code_of = np.full(len(row), code)
        columns = (code_of, row, which, column + at, inner[row, column])
        found.append(np.stack(columns, axis=1).astype(np.int32))
    return np.concatenate(found)


def fold(
    cells: Cells,
    book: CodeBook,
    seeds: NDArray[np.int32],
    *,
    bursts: int,
    reach: float,
    steps: int,
    clip: int,
) -> NDArray[np.int32]:
    """Largest sums of bursts around seeds: (n, 3) sum, interval step, index of first burst."""
    own = np.ascontiguousarray(seeds, np.int32).copy()
    own[:, 3] -= cells.base
    out = np.zeros((len(own), 3), np.int32)
    rows = cells.kept.shape[0]
    native = kernels()
    if native is None:
        for seed, best in zip(own, out, strict=True):
            best[:] = _fold_in_numpy(cells.kept, book, seed, bursts, reach, steps, clip)
        return out
    kept = np.ascontiguousarray(cells.kept)
    _, stretches, pulses = book.offsets.shape
    native.folds(
        *(kept, rows, kept.shape[1], own, len(own), book.offsets, stretches, pulses),
        *(book.intervals, float(reach), steps, bursts, clip, out),
    )
    return out


def _fold_in_numpy(
    kept: NDArray[np.uint8],
    book: CodeBook,
    seed: NDArray[np.int32],
    bursts: int,
    reach: float,
    steps: int,
    clip: int,
) -> tuple[int, int, int]:
    code, row, stretch, column, _ = seed.tolist()
    interval, own = float(book.intervals[code]), book.offsets[code, stretch]
    places = np.arange(1 - bursts, bursts)
    off = reach * np.arange(-steps, steps + 1) / max(steps, 1)
    base = column + np.floor(places * interval + 0.5).astype(np.int64)
    at = base[None] + np.floor(places[None] * off[:, None] + 0.5).astype(np.int64)
    where = at[:, :, None] + own
    # A burst whose search is partly outside the cells counts as zero.
    half = (reach * np.abs(places)).astype(np.int64) + 2
    inside = (base - half >= 0) & (base + half + 1 + own[-1] <= kept.shape[1])
    picked = np.minimum(kept[row, np.clip(where, 0, kept.shape[1] - 1)], clip)
    sums = picked.sum(axis=2, dtype=np.int64) * inside
    total = np.concatenate((np.zeros((len(off), 1), np.int64), np.cumsum(sums, axis=1)), axis=1)
    windows = total[:, bursts:] - total[:, :-bursts]
    # Of equal sums the first by position, then by interval, as in the kernel.
    first, which = np.unravel_index(int(windows.T.argmax()), windows.T.shape)
    return int(windows[which, first]), int(which) - steps, int(first) + 1 - bursts
