"""Sums over all pulses of a flight, for every interval and phase at once.

The fast folding algorithm (Staelin 1969, Proc. IEEE 57, 724): rows of one base period are added
in pairs, pairs in pairs, each time with all shifts that an interval between the base period and
one slot more makes, so that R rows of P slots cost P R log2 R additions instead of P R².
"""

import numpy as np
from numpy.typing import NDArray


def base_periods(shortest_s: float, longest_s: float, slot_s: float) -> range:
    """Base periods [slots] whose folds hold all intervals between two."""
    return range(int(shortest_s / slot_s), int(np.ceil(longest_s / slot_s)))


def fold(values: NDArray[np.float32], period: int) -> NDArray[np.float32]:
    """Add up what lies one interval apart.

    Parameters
    ----------
    values : ndarray of float32, shape (slots, many)
        Side by side in memory what is folded alike.
    period : int
        Base period [slots].

    Returns
    -------
    ndarray of float32, shape (rows, period, many)
        ``[d, p]``: the sum over the slots ``p + k (period + d / (rows - 1))``; rows is the next
        power of two to the number of periods in all slots.
    """
    slots, many = values.shape
    rows = fold_rows(slots, period)
    now = np.zeros((rows, 1, period, many), np.float32)
    now.reshape(-1, many)[:slots] = values
    # Two arrays for all levels: new pages for each would take as long as the sums.
    other = np.empty_like(now)
    blocks, size = rows, 1
    while blocks > 1:
        blocks //= 2
        then = other.reshape(blocks, 2 * size, period, many)
        early, late = now[0::2], now[1::2]
        for drift in range(2 * size):
            shift = ((drift + 1) // 2) % period
            out, one, two = then[:, drift], early[:, drift // 2], late[:, drift // 2]
            kept = period - shift
            np.add(one[:, :kept], two[:, shift:], out=out[:, :kept])
            if shift:
                np.add(one[:, kept:], two[:, :shift], out=out[:, kept:])
        now, other, size = then, now, 2 * size
    return np.asarray(now[0])


def fold_rows(slots: int, period: int) -> int:
    """Rows of a fold: the next power of two to the number of periods."""
    return 1 << (max(1, -(-slots // period)) - 1).bit_length()


def interval_slots(period: int, rows: int) -> NDArray[np.float64]:
    """Interval [slots] of each of a fold's rows, shape (rows,)."""
    return np.asarray(period + np.arange(rows) / max(rows - 1, 1))
