"""Sum energies over all pulses of a flight, for every interval and phase at once.

This is the fast folding algorithm (Staelin 1969, Proc. IEEE 57, 724): rows of one base period
are added in pairs, their sums again in pairs, and so on. Each step uses all shifts for
intervals from the base period to one slot more. So R rows of P slots need P R log2 R additions
instead of P R².
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels


def base_periods(shortest_s: float, longest_s: float, slot_s: float) -> range:
    """Base periods whose folds together contain all intervals between two given ones
    [slots].
    """
    return range(int(shortest_s / slot_s), int(np.ceil(longest_s / slot_s)))


def fold(
    values: NDArray[np.float32], period: int, first: int = 0, end: int | None = None
) -> NDArray[np.float32]:
    """Sum the values that are one interval apart, for all intervals of one base period.

    `values` (many, slots): arrays that are all folded in the same manner. `period`: base period
    [slots]. `first`, `end`: range of rows of the fold that are returned, by default all.
    Returns (many, rows, period) ``[i, d - first, p]``, the sum of the i-th values over the
    slots ``p + k (period + d / (rows - 1))``. The number of rows is the next power of two to
    the number of periods in all slots.
    """
    many, slots = values.shape
    rows = fold_rows(slots, period)
    end = rows if end is None else end
    native = kernels()
    if native is None:
        return _fold_numpy(values, period, first, end)
    out = np.empty((many, end - first, period), np.float32)
    levels = rows.bit_length() - 1
    values = np.ascontiguousarray(values, np.float32)
    native.train_sums(values, many, slots, period, levels, first, end - first, out)
    return out


def _fold_numpy(
    values: NDArray[np.float32], period: int, first: int, end: int
) -> NDArray[np.float32]:
    many, slots = values.shape
    rows = fold_rows(slots, period)
    now = np.zeros((rows, 1, period, many), np.float32)
    now.reshape(-1, many)[:slots] = values.T
    # Two arrays for all levels: allocating new pages would take as long as the sums.
    other = np.empty_like(now)
    blocks, size = rows, 1
    while blocks > 1:
        blocks //= 2
        then = other.reshape(blocks, 2 * size, period, many)
        early, late = now[0::2], now[1::2]
        # The wanted intervals that this level distinguishes.
        for drift in range(first // blocks, (end - 1) // blocks + 1):
            shift = ((drift + 1) // 2) % period
            out, one, two = then[:, drift], early[:, drift // 2], late[:, drift // 2]
            kept = period - shift
            np.add(one[:, :kept], two[:, shift:], out=out[:, :kept])
            if shift:
                np.add(one[:, kept:], two[:, :shift], out=out[:, kept:])
        now, other, size = then, now, 2 * size
    return np.ascontiguousarray(np.moveaxis(now[0, first:end], 2, 0))


def highest(
    sums: NDArray[np.float32], mixing: NDArray[np.float32], scale: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
    """Highest score of each position, computed from the patterns' sums by `mixing`, and its
    flat index.
    """
    patterns, rows, period = sums.shape
    places = len(mixing)
    native = kernels()
    if native is None:
        mixed = (mixing @ sums.reshape(patterns, -1)).reshape(places, rows, period)
        flat = (mixed * scale[:, np.newaxis]).reshape(places, -1)
        best = flat.argmax(axis=1)
        return flat[np.arange(places), best], best
    score, cell = np.empty(places, np.float32), np.empty(places, np.int32)
    sums, mixing = np.ascontiguousarray(sums), np.ascontiguousarray(mixing)
    native.train_peaks(sums, patterns, rows, period, scale, mixing, score, cell)
    return score, cell.astype(np.intp)


def slots_added(slots: int, period: int, row: int, phase: int) -> NDArray[np.intp]:
    """Indices of the slots whose values a fold adds in the cell at a row and phase."""
    rows = fold_rows(slots, period)
    levels = rows.bit_length() - 1
    number = np.arange(rows)
    shift = np.zeros(rows, np.intp)
    for level in range(levels):
        late = (number >> (levels - 1 - level)) & 1
        shift += late * (((row >> level) + 1) // 2)
    at = number * period + (phase + shift) % period
    return np.asarray(at[at < slots])


def fold_rows(slots: int, period: int) -> int:
    """Number of rows of a fold: the next power of two to the number of periods."""
    return 1 << (max(1, -(-slots // period)) - 1).bit_length()


def interval_slots(period: int, rows: int) -> NDArray[np.float64]:
    """Interval of each row of a fold [slots], shape (rows,)."""
    return np.asarray(period + np.arange(rows) / max(rows - 1, 1))
