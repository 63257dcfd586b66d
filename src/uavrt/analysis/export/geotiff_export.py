"""Encode a heat map as GeoTIFF (OGC 19-008r4): one strip of float32 on WGS84.

::

    "II" 42 | directory | values of its longer entries | pixels, top row first

Pixels are probabilities of cells that sum to 1. Cells are square in metres; their size in
degrees is that at the map's middle (see `uavrt.analysis.export.kmz.bounds`).
"""

import struct

import numpy as np

from uavrt.analysis.export.kmz import bounds
from uavrt.core.units import wrap_degrees_360
from uavrt.localization.position.levels.strongest import SignalSurface
from uavrt.localization.results import PositionGrid

_SHORT, _LONG, _ASCII, _DOUBLE = 3, 4, 2, 12
_SIZES = {_SHORT: 2, _LONG: 4, _ASCII: 1, _DOUBLE: 8}
_FORMATS = {_SHORT: "H", _LONG: "I", _DOUBLE: "d"}

# Version 1.1.0, four keys: geographic model, pixels are areas, EPSG 4326, degrees.
_GEO_KEYS = (
    *(1, 1, 0, 4),
    *(1024, 0, 1, 2),
    *(1025, 0, 1, 1),
    *(2048, 0, 1, 4326),
    *(2054, 0, 1, 9102),
)


def geotiff_bytes(grid: PositionGrid | SignalSurface, description: str) -> bytes:
    """Encode a heat map, or a map of SNR [dB] with NaN where unknown, as GeoTIFF with an image
    `description`. The north axis of `grid` may ascend or descend.
    """
    rising = grid.north_m[-1] >= grid.north_m[0]
    cells = grid.probability if isinstance(grid, PositionGrid) else grid.snr_db
    pixels = np.asarray(cells, "<f4")
    pixels = np.ascontiguousarray(pixels[::-1] if rising else pixels)
    rows, columns = pixels.shape
    west, south, east, north = bounds(grid)
    scale = (wrap_degrees_360(east - west) / columns, (north - south) / rows, 0.0)
    entries: list[tuple[int, int, tuple[float, ...] | bytes]] = [
        (256, _LONG, (columns,)),
        (257, _LONG, (rows,)),
        (258, _SHORT, (32,)),
        (259, _SHORT, (1,)),
        (262, _SHORT, (1,)),
        (270, _ASCII, description.encode("ascii", "replace") + b"\0"),
        (273, _LONG, (0,)),  # where the pixels are; known below
        (277, _SHORT, (1,)),
        (278, _LONG, (rows,)),
        (279, _LONG, (pixels.nbytes,)),
        (339, _SHORT, (3,)),
        (33550, _DOUBLE, scale),
        (33922, _DOUBLE, (0.0, 0.0, 0.0, west, north, 0.0)),
        (34735, _SHORT, _GEO_KEYS),
    ]
    start = 8 + 2 + 12 * len(entries) + 4
    length = sum(_padded(kind, value) for _, kind, value in entries)
    entries[6] = (273, _LONG, (start + length,))
    directory, values = b"", b""
    for tag, kind, value in entries:
        packed, count = _packed(kind, value)
        if len(packed) > 4:
            place = struct.pack("<I", start + len(values))
            values += packed + b"\0" * (len(packed) % 2)
        else:
            place = packed.ljust(4, b"\0")
        directory += struct.pack("<HHI", tag, kind, count) + place
    head = struct.pack("<2sHIH", b"II", 42, 8, len(entries))
    return head + directory + struct.pack("<I", 0) + values + pixels.tobytes()


def _packed(kind: int, value: tuple[float, ...] | bytes) -> tuple[bytes, int]:
    if isinstance(value, bytes):
        return value, len(value)
    return struct.pack(f"<{len(value)}{_FORMATS[kind]}", *value), len(value)


def _padded(kind: int, value: tuple[float, ...] | bytes) -> int:
    size = len(value) * _SIZES[kind]
    return 0 if size <= 4 else size + size % 2
