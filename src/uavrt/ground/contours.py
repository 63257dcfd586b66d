"""Level lines of a grid by marching squares; NumPy alone."""

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]

_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
"""Corners of a cell anticlockwise from south-west, and the edges between them."""
_CASES: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((3, 0),), 2: ((0, 1),), 3: ((3, 1),), 4: ((1, 2),), 5: ((3, 0), (1, 2)),
    6: ((0, 2),), 7: ((3, 2),), 8: ((2, 3),), 9: ((2, 0),), 10: ((0, 1), (2, 3)),
    11: ((2, 1),), 12: ((1, 3),), 13: ((1, 0),), 14: ((0, 3),),
}  # fmt: skip
"""For each pattern of corners at or above the level (bit 0 south-west): edges to join."""


def contour_segments(x: _Floats, y: _Floats, values: _Floats, level: float) -> _Floats:
    """Find where a surface crosses a level.

    Parameters
    ----------
    x, y : (nx,), (ny,) float64 arrays
        Where the columns and the rows are.
    values : (ny, nx) float64 array
        The surface.
    level : float
        Height of the line.

    Returns
    -------
    (n, 2, 2) float64 array
        Pieces of line: two ends of x and y each. Joined they are closed, or end at the border.
    """
    # A border of nothing closes the lines at the edge of the grid.
    padded = np.pad(values, 1, constant_values=0.0)
    step_x, step_y = x[1] - x[0], y[1] - y[0]
    x = np.concatenate([[x[0] - step_x], x, [x[-1] + step_x]])
    y = np.concatenate([[y[0] - step_y], y, [y[-1] + step_y]])
    corners = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]]
    case = np.zeros(corners[0].shape, np.int64)
    for bit, corner in enumerate(corners):
        case += (corner >= level).astype(np.int64) << bit
    pieces = []
    for number, joins in _CASES.items():
        rows, columns = np.nonzero(case == number)
        if not len(rows):
            continue
        for first, second in joins:
            ends = [
                _crossing(x, y, corners, rows, columns, edge, level) for edge in (first, second)
            ]
            pieces.append(np.stack(ends, axis=1))
    return np.concatenate(pieces) if pieces else np.empty((0, 2, 2))


def refined(
    x: _Floats, y: _Floats, probability: _Floats, times: int = 4
) -> tuple[_Floats, _Floats, _Floats]:
    """Refine a probability over a grid: its logarithm by cubics through four neighbours.

    Returns
    -------
    x, y : (times (nx - 1) + 1,), (times (ny - 1) + 1,) float64 arrays
        The finer grid.
    probability : float64 array
        Sums to 1.
    """
    # Below 1e-12 of the peak nothing is drawn; a zero has no logarithm.
    logs = np.log(np.maximum(probability, 1e-12 * probability.max()))
    fine = np.exp(_cubic(_cubic(logs, times).T, times).T)
    return (
        np.linspace(x[0], x[-1], times * (len(x) - 1) + 1),
        np.linspace(y[0], y[-1], times * (len(y) - 1) + 1),
        fine / fine.sum(),
    )


def _cubic(values: _Floats, times: int) -> _Floats:
    """Catmull-Rom interpolation along the last axis; the ends are carried on straight."""
    first = 2.0 * values[:, :1] - values[:, 1:2]
    last = 2.0 * values[:, -1:] - values[:, -2:-1]
    p = np.concatenate([first, values, last], axis=1)
    p0, p1, p2, p3 = (p[:, place : place + values.shape[1] - 1] for place in range(4))
    t = (np.arange(times) / times)[None, None, :]
    p0, p1, p2, p3 = (part[:, :, None] for part in (p0, p1, p2, p3))
    between = 0.5 * (
        2.0 * p1
        + (p2 - p0) * t
        + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * t**2
        + (3.0 * p1 - p0 - 3.0 * p2 + p3) * t**3
    )
    return np.concatenate([between.reshape(len(values), -1), values[:, -1:]], axis=1)


def _crossing(
    x: _Floats,
    y: _Floats,
    corners: list[_Floats],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    edge: int,
    level: float,
) -> _Floats:
    """Where the level crosses one edge of each of some cells, (cells, 2)."""
    start, stop = _EDGES[edge]
    below, above = corners[start][rows, columns], corners[stop][rows, columns]
    part = (level - below) / (above - below)
    xs = [x[columns + (corner in (1, 2))] for corner in (start, stop)]
    ys = [y[rows + (corner in (2, 3))] for corner in (start, stop)]
    return np.stack([xs[0] + part * (xs[1] - xs[0]), ys[0] + part * (ys[1] - ys[0])], axis=1)
