"""Read GeoTIFF elevation files (TIFF 6.0, BigTIFF, OGC 19-008r4).

Supported are strips or tiles of one band, int16 to float64, in longitude and latitude or UTM.
They may be compressed by deflate or LZW, each with predictors, or by PackBits. Only the
required blocks are read. The error for any other kind of file states the command that converts
it.
"""

import math
import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import FormatError
from uavrt.core.foreign import require_plain_file
from uavrt.localization.terrain.elevation import Raster

SUFFIXES = (".tif", ".tiff")
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 11: 4, 12: 8, 13: 4, 16: 8}
_KINDS = {1: "B", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 11: "f", 12: "d", 13: "I", 16: "Q"}
_READ = frozenset(
    {256, 257, 258, 259, 273, 277, 278, 279, 317, 322, 323, 324, 325, 339}
    | {33550, 33922, 34264, 34735, 42113}
)
"""Numbers of the TIFF tags that are read; all other tags are ignored."""
_MOST_BLOCKS, _MOST_VALUES = 300_000, 4096
"""Maximum number of values of the TIFF tags that list blocks, and of each other tag."""
_LISTS = frozenset({273, 279, 324, 325})
_MOST_BLOCK_POINTS = 1 << 24
_SCALES = 1e-8, 1e8
"""Range of valid grid steps [deg or m]; the upper end also limits the coordinates of the
corner."""
_NUMBERS = {(1, 8): "u1", (1, 16): "u2", (1, 32): "u4", (2, 16): "i2", (2, 32): "i4"} | {
    (3, 32): "f4",
    (3, 64): "f8",
}
_PLAIN, _LZW, _DEFLATE, _OLD_DEFLATE, _PACKBITS = 1, 5, 8, 32946, 32773
_DATUMS = {
    5773: "EGM96",
    3855: "EGM2008",
    5798: "EGM84",
    5703: "NAVD88",
    5730: "EVRF2000",
    5621: "EVRF2007",
    5783: "DHHN92",
    7837: "DHHN2016",
    5030: "ellipsoid",
    4979: "ellipsoid",
}
_DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    OverflowError,
    struct.error,
    zlib.error,
)


class _Unread(Exception):
    """Error for an unsupported kind of GeoTIFF, with the options of gdal_translate or gdalwarp
    that convert it.
    """


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Blocks:
    path: Path
    order: str
    rows: int
    columns: int
    high: int
    wide: int
    places: tuple[int, ...]
    sizes: tuple[int, ...]
    packed: int
    predictor: int
    dtype: np.dtype[Any]
    nodata: float | None


def geotiff_raster(path: Path) -> Raster:
    """Open a GeoTIFF file. Raises `FormatError` if it is damaged, has no position, or is not
    supported.
    """
    try:
        require_plain_file(path)
        with path.open("rb") as file:
            order, tags = _directory(file)
        return _raster(path, order, tags)
    except _Unread as error:
        text, command = error.args
        raise FormatError(
            f"{path.name}: {text}", remedy=f"Run: {command} {path.name} turned.tif"
        ) from None
    except _DAMAGED as error:
        # Other errors come from the decoding library and would not help the user.
        readable = isinstance(error, OSError | ValueError) and not isinstance(
            error, UnicodeError
        )
        why = str(error) if readable else "the TIFF tags are invalid"
        raise FormatError(
            f"{path.name} is not a GeoTIFF, or truncated: {why}",
            remedy="Download the file again",
        ) from error


def _directory(file: BinaryIO) -> tuple[str, dict[int, Any]]:
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None or len(head) < 8:
        raise ValueError("the file does not begin like a TIFF file")
    version = struct.unpack(order + "H", head[2:4])[0]
    big = version == 43
    if version not in (42, 43):
        raise ValueError("the file does not begin like a TIFF file")
    offset = struct.unpack(order + ("Q" if big else "I"), head[8:16] if big else head[4:8])[0]
    file.seek(offset)
    count = struct.unpack(order + ("Q" if big else "H"), file.read(8 if big else 2))[0]
    entry = 20 if big else 12
    if count > 4096:
        raise ValueError(f"the file has {count} TIFF tags, more than 4096")
    table = file.read(entry * count)
    tags: dict[int, Any] = {}
    for number in range(count):
        one = table[number * entry : (number + 1) * entry]
        tag, kind = struct.unpack(order + "HH", one[:4])
        length = struct.unpack(order + ("Q" if big else "I"), one[4 : 12 if big else 8])[0]
        value = one[12:] if big else one[8:]
        if tag not in _READ or tag in tags or kind not in _SIZES:
            continue
        if length > (_MOST_BLOCKS if tag in _LISTS else _MOST_VALUES):
            continue
        size = _SIZES[kind] * length
        if size > len(value):
            file.seek(struct.unpack(order + ("Q" if big else "I"), value)[0])
            value = file.read(size)
            if len(value) < size:
                raise ValueError("the file ends within the TIFF tags")
        if kind == 2:
            tags[tag] = value[:size].split(b"\0")[0].decode("latin-1")
        elif kind in _KINDS:
            tags[tag] = struct.unpack(f"{order}{length}{_KINDS[kind]}", value[:size])
    return order, tags


def _raster(path: Path, order: str, tags: dict[int, Any]) -> Raster:
    columns, rows = int(tags[256][0]), int(tags[257][0])
    if tags.get(277, (1,))[0] != 1:
        raise _Unread(
            f"the file has {tags[277][0]} bands instead of one", "gdal_translate -b 1"
        )
    number = (tags.get(339, (1,))[0], tags.get(258, (1,))[0])
    packed = tags.get(259, (1,))[0]
    known = (_PLAIN, _LZW, _DEFLATE, _OLD_DEFLATE, _PACKBITS)
    if number not in _NUMBERS or packed not in known:
        raise _Unread(
            f"the compression ({packed}, {number[1]} bits) is not supported",
            "gdal_translate -ot Float32 -co COMPRESS=DEFLATE",
        )
    tiled = 322 in tags
    blocks = _Blocks(
        path=path,
        order=order,
        rows=rows,
        columns=columns,
        high=int(tags[323][0]) if tiled else min(int(tags.get(278, (rows,))[0]), rows),
        wide=int(tags[322][0]) if tiled else columns,
        places=tags[324 if tiled else 273],
        sizes=tags[325 if tiled else 279],
        packed=packed,
        predictor=tags.get(317, (1,))[0],
        dtype=np.dtype(order + _NUMBERS[number]),
        nodata=_number(tags.get(42113)),
    )
    _check(blocks)
    epsg, datum, point = _system(tags)
    x, y, step_x, step_y = _origin(tags)
    least, most = _SCALES
    placed = abs(x) < most and abs(y) < most
    if not (placed and least < step_x < most and least < step_y < most):
        raise ValueError(f"the origin {x:g}, {y:g} or step {step_x:g}, {step_y:g} is invalid")
    half = 0.0 if point else 0.5
    return Raster(
        name=path.name,
        epsg=epsg,
        x=x + half * step_x,
        y=y - half * step_y,
        step_x=step_x,
        step_y=step_y,
        rows=rows,
        columns=columns,
        datum=datum,
        read=lambda window: _points(blocks, window),
    )


def _check(blocks: _Blocks) -> None:
    if min(blocks.rows, blocks.columns, blocks.high, blocks.wide) < 1:
        raise ValueError("the file contains no heights")
    if blocks.high * blocks.wide > _MOST_BLOCK_POINTS:
        raise _Unread("the blocks of the file are too large", "gdal_translate -co TILED=YES")
    count = math.ceil(blocks.rows / blocks.high) * math.ceil(blocks.columns / blocks.wide)
    if len(blocks.places) < count or len(blocks.sizes) < count:
        raise ValueError(f"the file lists only {len(blocks.places)} of {count} blocks")
    ends = max(at + size for at, size in zip(blocks.places, blocks.sizes, strict=True))
    there = os.stat(blocks.path).st_size
    if ends > there:
        raise ValueError(f"the file has only {there:,} of {ends:,} bytes")


def _number(text: object) -> float | None:
    try:
        return float(str(text))
    except ValueError:
        return None


def _system(tags: dict[int, Any]) -> tuple[int, str | None, bool]:
    """Return the coordinate system, the datum of the heights, and whether values are at points
    (not averages of cells).
    """
    warp = "gdalwarp -t_srs EPSG:4326"
    listed = tags.get(34735)
    if listed is None:
        raise _Unread("the coordinate system is missing", "gdal_translate -a_srs EPSG:4326")
    keys = {
        listed[at]: listed[at + 3] for at in range(4, len(listed) - 3, 4) if not listed[at + 1]
    }
    if keys.get(4099, 9001) != 9001:
        raise _Unread("the heights are not in metres", "gdal_translate -scale")
    geographic, projected = keys.get(2048, 0), keys.get(3072, 0)
    if keys.get(1024) == 1:
        epsg = _utm_of(projected)
        if epsg is None:
            raise _Unread(f"the coordinate system EPSG:{projected} is not supported", warp)
    elif geographic in (4326, 4258, 4269, 4979):
        epsg = 4326
    else:
        raise _Unread(f"the coordinate system EPSG:{geographic} is not supported", warp)
    vertical = 4979 if geographic == 4979 else keys.get(4096)
    datum = None if vertical is None else _DATUMS.get(vertical, f"EPSG {vertical}")
    return epsg, datum, keys.get(1025) == 2


def _utm_of(epsg: int) -> int | None:
    """Return the EPSG code of the same UTM zone on WGS 84; also for ETRS89 and NAD83, which
    differ by less than 2 m. None for other codes.
    """
    zone = epsg % 100
    if epsg // 100 in (326, 327) and 1 <= zone <= 60:
        return epsg
    if (epsg // 100 == 258 and 28 <= zone <= 38) or (epsg // 100 == 269 and 1 <= zone <= 23):
        return 32600 + zone
    return None


def _origin(tags: dict[int, Any]) -> tuple[float, float, float, float]:
    if 34264 in tags:
        xx, xy, _, x, yx, yy, _, y = tags[34264][:8]
        if xy or yx or xx <= 0.0 or yy >= 0.0:
            raise _Unread("the grid is rotated", "gdalwarp -t_srs EPSG:4326")
        return x, y, xx, -yy
    step_x, step_y = tags[33550][:2]
    column, row, _, x, y = tags[33922][:5]
    if not (step_x > 0.0 and step_y > 0.0):
        raise ValueError("the pixel size is not positive")
    return x - column * step_x, y + row * step_y, step_x, step_y


def _points(blocks: _Blocks, window: tuple[int, int, int, int]) -> NDArray[np.float32]:
    top, bottom, left, right = window
    points = np.full((bottom - top, right - left), np.nan, np.float32)
    across = math.ceil(blocks.columns / blocks.wide)
    try:
        # Damaged floating-point numbers must not cause warnings.
        with blocks.path.open("rb") as file, np.errstate(all="ignore"):
            for i in range(top // blocks.high, (bottom - 1) // blocks.high + 1):
                for j in range(left // blocks.wide, (right - 1) // blocks.wide + 1):
                    some = _block(file, blocks, i * across + j)
                    r, c = i * blocks.high, j * blocks.wide
                    r0, r1 = max(top, r), min(bottom, r + len(some))
                    c0, c1 = max(left, c), min(right, c + blocks.wide)
                    part = some[r0 - r : r1 - r, c0 - c : c1 - c]
                    points[r0 - top : r1 - top, c0 - left : c1 - left] = part
    except _DAMAGED as error:
        raise FormatError(
            f"{blocks.path.name} is damaged: {error}", remedy="Download the file again"
        ) from error
    return points


def _block(file: BinaryIO, blocks: _Blocks, number: int) -> NDArray[np.float32]:
    high = blocks.high
    if blocks.wide == blocks.columns:  # the last strip is cut to the picture, a tile never
        high = min(high, blocks.rows - number * high) if high < blocks.rows else high
    shape, kind = (high, blocks.wide), blocks.dtype
    size = high * blocks.wide * kind.itemsize
    if not blocks.sizes[number]:  # omitted where no height is known
        return np.full(shape, np.nan, np.float32)
    file.seek(blocks.places[number])
    data = file.read(blocks.sizes[number])
    if blocks.packed in (_DEFLATE, _OLD_DEFLATE):
        data = zlib.decompressobj().decompress(data, size)
    elif blocks.packed == _LZW:
        data = _unpacked_lzw(data, size)
    elif blocks.packed == _PACKBITS:
        data = _unpacked_bits(data, size)
    if len(data) < size:
        raise ValueError(f"block {number} has only {len(data):,} of {size:,} bytes")
    heights = _unpredicted(data[:size], shape, kind, blocks.predictor)
    if blocks.nodata is not None:
        gone = np.isnan(heights) if math.isnan(blocks.nodata) else heights == blocks.nodata
        heights[gone] = np.nan
    return np.asarray(heights, np.float32)


def _unpredicted(
    data: bytes, shape: tuple[int, int], kind: np.dtype[Any], predictor: int
) -> NDArray[Any]:
    """Undo TIFF predictor 2 (differences of neighbours) or 3 (bytes of floating-point
    numbers).
    """
    if predictor == 3:
        width = kind.itemsize
        rows = np.frombuffer(data, np.uint8).reshape(shape[0], width * shape[1])
        summed = np.cumsum(rows, axis=1, dtype=np.uint8)
        # The most significant bytes of all points come first.
        planes = summed.reshape(shape[0], width, shape[1]).transpose(0, 2, 1)
        return np.ascontiguousarray(planes).view(kind.newbyteorder(">"))[..., 0].astype("f4")
    points = np.frombuffer(data, kind).reshape(shape)
    if predictor == 2:
        whole = np.dtype(f"{kind.byteorder}u{kind.itemsize}")
        native = np.dtype(f"u{kind.itemsize}")
        summed = np.cumsum(points.view(whole).astype(native), axis=1, dtype=native)
        points = summed.view(kind.newbyteorder("="))
    return points.astype("f4")


def _unpacked_bits(data: bytes, size: int) -> bytes:
    """Unpack PackBits data (TIFF 6.0, section 9)."""
    found, at = bytearray(), 0
    while at < len(data) and len(found) < size:
        count = data[at]
        if count < 128:
            found += data[at + 1 : at + 2 + count]
            at += 2 + count
        else:
            if count > 128:
                found += data[at + 1 : at + 2] * (257 - count)
            at += 2
    return bytes(found)


def _unpacked_lzw(data: bytes, size: int) -> bytes:
    """Unpack LZW data (TIFF 6.0, section 13): codes of 9 to 12 bits, of which 256 clears the
    table and 257 ends.
    """
    found, length = [], 0
    table = [bytes((value,)) for value in range(256)] + [b"", b""]
    width, bits, held, last = 9, 0, 0, b""
    for byte in data:
        held = (held << 8) | byte
        bits += 8
        if bits < width:
            continue
        bits -= width
        code = held >> bits
        held &= (1 << bits) - 1
        if code == 257:
            break
        if code == 256:
            del table[258:]
            width, last = 9, b""
            continue
        if code < len(table):
            text = table[code]
        elif code == len(table) and last:
            text = last + last[:1]
        else:
            raise ValueError("the LZW data are invalid")
        found.append(text)
        length += len(text)
        if length >= size:
            break
        if last and len(table) < 4096:
            table.append(last + text[:1])
        last = text
        # One code early, as all writers of TIFF do.
        if len(table) + 1 >= 1 << width and width < 12:
            width += 1
    return b"".join(found)
