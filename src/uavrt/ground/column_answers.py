"""Columns of a flight as answers to a request: bytes, and their names in a header."""

import numpy as np
from numpy.typing import NDArray
from starlette.responses import Response

from uavrt.errors import FormatError
from uavrt.ground.flights import yaw_deg

POSE_COLUMNS = (
    "time_ns",
    "latitude_deg",
    "longitude_deg",
    "altitude_relative_m",
    "quaternion_w",
    "quaternion_x",
    "quaternion_y",
    "quaternion_z",
)
YAW = "yaw_deg"
"""Made from the quaternion where it is asked for by name."""


def chosen_columns(
    cells: NDArray[np.float64], columns: tuple[str, ...], names: str | None
) -> Response:
    """Answer with columns of little-endian float64.

    Parameters
    ----------
    cells : ndarray
        (len(columns), n).
    columns : tuple of str
        Their names; the quaternion's are ``quaternion_w`` and the three after it.
    names : str, optional
        Those that are wanted, in the wanted order, between commas; ``yaw_deg`` may be among
        them. None: all of `columns`.

    Raises
    ------
    FormatError
        There is no such column.
    """
    wanted = columns if names is None else tuple(names.split(","))
    unknown = set(wanted) - {*columns, YAW}
    if unknown:
        raise FormatError(
            f"there is no column {min(unknown)[:40]!r}",
            remedy=f"Columns are {', '.join((*columns, YAW))}",
        )
    body = b"".join(_column(cells, columns, name) for name in wanted)
    headers = {"X-Columns": ",".join(wanted)}
    return Response(body, media_type="application/octet-stream", headers=headers)


def thinned(cells: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Take every so manieth of (m, n) columns, so that `most` are left, and the last one."""
    count = cells.shape[1]
    step = max(1, -(-count // max(1, most)))
    # Backwards, because where the drone is now matters more than where it began.
    return cells[:, (count - 1) % step :: step] if count else cells


def _column(cells: NDArray[np.float64], columns: tuple[str, ...], name: str) -> bytes:
    if name == YAW:
        first = columns.index("quaternion_w")
        column = yaw_deg(cells[first : first + 4])
    else:
        column = cells[columns.index(name)]
    return np.asarray(column, "<f8").tobytes()
