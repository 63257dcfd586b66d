"""Read elevation tiles of the Shuttle Radar Topography Mission, plain or zipped.

A tile is one degree wide and high; its name is its south-western corner (``N47E008.hgt``). It
has 3601² heights (one arc second) or 1201² (three), big-endian int16, northern row first.
Neighbouring tiles share their border rows and columns. -32768 marks a missing height. Heights
are above the geoid EGM96 ("SRTM Collection User Guide", NASA LP DAAC, 2015).
"""

import re
import zipfile
import zlib
from lzma import LZMAError
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import FormatError
from uavrt.core.foreign import ZIPPED_TILE, open_zip, size_of
from uavrt.localization.terrain.elevation import Raster

SUFFIXES = (".hgt", ".hgt.zip")
_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3})", re.IGNORECASE)
_SIDES = {side * side * 2: side for side in (1201, 3601)}
_VOID = -32768
_AGAIN = "Download the file again"
_DAMAGED = (
    OSError,
    EOFError,
    ValueError,
    OverflowError,
    RuntimeError,  # encrypted, or packed in a way that zipfile does not know
    zipfile.BadZipFile,
    zlib.error,
    LZMAError,
)


def srtm_raster(path: Path) -> Raster:
    """Open an SRTM tile. Raises `FormatError` if it is incomplete or its name states no
    position.
    """
    named = _NAME.match(path.name)
    if named is None:
        raise FormatError(
            f"the file name {path.name} gives no position",
            remedy="Rename the file after its position: N47E008.hgt covers 47 to 48° north, "
            "8 to 9° east",
        )
    south = int(named[2]) * (1 if named[1].upper() == "N" else -1)
    west = int(named[4]) * (1 if named[3].upper() == "E" else -1)
    try:
        size = _zipped(path)[1] if path.suffix.lower() == ".zip" else size_of(path)
    except _DAMAGED as error:
        raise FormatError(f"{path} cannot be read: {error}", remedy=_AGAIN) from error
    side = _SIDES.get(size)
    if side is None:
        sizes = " or ".join(f"{known:,}" for known in _SIDES)
        raise FormatError(
            f"{path.name} is truncated or not a tile: {size:,} bytes, not {sizes}",
            remedy=_AGAIN,
        )
    step = 1.0 / (side - 1)
    return Raster(
        name=path.name,
        epsg=4326,
        x=float(west),
        y=float(south + 1),
        step_x=step,
        step_y=step,
        rows=side,
        columns=side,
        datum="EGM96",
        read=lambda window: _points(path, side, window),
    )


def _zipped(path: Path) -> tuple[str, int]:
    with open_zip(path, ZIPPED_TILE) as archive:
        found = [one for one in archive.infolist() if one.filename.lower().endswith(".hgt")]
        if len(found) != 1:
            raise ValueError(f"the file has {len(found)} tiles, not one")
        return found[0].filename, found[0].file_size


def _points(path: Path, side: int, window: tuple[int, int, int, int]) -> NDArray[np.float32]:
    top, bottom, left, right = window
    try:
        if path.suffix.lower() == ".zip":
            with open_zip(path, ZIPPED_TILE) as archive:
                tile = np.frombuffer(archive.read(_zipped(path)[0]), ">i2").reshape(side, side)
        else:
            tile = np.memmap(path, ">i2", "r", shape=(side, side))
    except _DAMAGED as error:
        raise FormatError(f"{path} cannot be read: {error}", remedy=_AGAIN) from error
    part = np.asarray(tile[top:bottom, left:right])
    return np.where(part == _VOID, np.float32(np.nan), part.astype(np.float32))
