"""Send columns of a flight as bytes, with their names in an HTTP header."""

import numpy as np
from numpy.typing import NDArray
from starlette.responses import Response

from uavrt.core.errors import NotFound
from uavrt.ground.store.stored_flights import PLACE_COLUMNS
from uavrt.localization.headings import yaws_deg

POSE_COLUMNS = ("time_ns", *PLACE_COLUMNS)
YAW = "yaw_deg"
"""Name of the column of the drone's yaw, computed from the quaternion on request."""


def chosen_columns(
    cells: NDArray[np.float64], columns: tuple[str, ...], names: str | None
) -> Response:
    """Response of the requested columns as little-endian float64.

    `names`: separated by commas, also ``yaw_deg``; None: all columns.
    """
    wanted = columns if names is None else tuple(names.split(","))
    unknown = set(wanted) - {*columns, YAW}
    if unknown:
        raise NotFound(
            f"there is no column {min(unknown)[:40]!r}",
            remedy=f"Available columns: {', '.join((*columns, YAW))}",
        )
    # One array, sent as it is: of 100 000 pulses it is 8 MB, and a copy would be as much again.
    body = np.empty((len(wanted), cells.shape[1]), "<f8")
    for row, name in zip(body, wanted, strict=True):
        row[:] = _column(cells, columns, name)
    headers = {"X-Columns": ",".join(wanted)}
    return Response(
        body.reshape(-1).view(np.uint8).data,
        media_type="application/octet-stream",
        headers=headers,
    )


def thinned(cells: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Thin the columns of an array (m, n) evenly to `most`; the last one is always kept."""
    count = cells.shape[1]
    step = max(1, -(-count // max(1, most)))
    # Backwards, because where the drone is now matters more than where it began.
    return cells[:, (count - 1) % step :: step] if count else cells


def _column(
    cells: NDArray[np.float64], columns: tuple[str, ...], name: str
) -> NDArray[np.float64]:
    if name == YAW:
        first = columns.index("quaternion_w")
        return yaws_deg(cells[first : first + 4].T)
    column: NDArray[np.float64] = cells[columns.index(name)]
    return column
