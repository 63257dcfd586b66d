"""Read metadata and tiles of map files in the formats PMTiles 3 and MBTiles 1.3.

PMTiles files are read by the specification's version 3 (header §3, directories §4, tile ids on
a Hilbert curve §4.1). The files are untrusted, so sizes are checked before anything is read.
"""

import math
import re
import sqlite3
import struct
import zlib
from collections.abc import Iterable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from uavrt.core.errors import FormatError
from uavrt.core.foreign import MAP_PART, read_json, require_plain_file
from uavrt.flight.database.plain_database import limit_queries

SUFFIXES = (".pmtiles", ".mbtiles")
RASTERS = ("png", "jpg", "webp")
"""Tile formats that are pictures; the only other format, ``mvt``, contains lines and areas."""
MOST_TILE = 2_000_000
_MOST_CREDIT = 4000
MAP_QUERY_S = 0.7
"""Longest duration of a query in a map's database [s]; reading a tile takes a millisecond."""
_MOST_FACTS = 500
"""Maximum number of metadata rows read from an MBTiles file; the specification defines 14."""
_MOST_ZOOM = 30
_MOST_LONGITUDE = 180.1
_EARTH = "-180,-85,180,85"
_HEADER = 127
_LEAF_LEVELS = 4
_DAMAGED = (
    *(OSError, ValueError, IndexError, OverflowError, EOFError, StopIteration),
    *(struct.error, zlib.error, sqlite3.Error, TypeError, RecursionError),
)
_TYPES = {1: "mvt", 2: "png", 3: "jpg", 4: "webp", 5: "avif"}
_NOT_COMPRESSED, _GZIP = 1, 2


class _OtherCompressionError(ValueError):
    """The index of a PMTiles file is compressed by a method that uavrt does not support."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFile:
    """An open map file and its metadata."""

    path: Path
    format: str
    """File format of the map, ``pmtiles`` or ``mbtiles``."""
    tiles: str
    """Format of the map's tiles: ``png``, ``jpg``, ``webp`` or ``mvt``."""
    min_zoom: int
    max_zoom: int
    bounds: tuple[float, float, float, float]
    """West, south, east and north edge of the map [deg]."""
    attribution: str | None

    @property
    def credit(self) -> str:
        """Attribution that must be shown with the map."""
        return self.attribution or self.path.name

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """Stored bytes of a tile; None if missing. Raises `FormatError` for a damaged file."""
        if not 0 <= z <= _MOST_ZOOM:
            return None
        try:
            return (
                _pmtiles_tile(self.path, z, x, y)
                if self.format == "pmtiles"
                else _mbtiles_tile(self.path, z, x, y)
            )
        except _DAMAGED as error:
            text = f"{self.path.name} cannot be read: {error}"
            remedy = "Download the file again"
            if isinstance(error, _OtherCompressionError):
                remedy = "Convert the map to MBTiles, or write its index with gzip"
            raise FormatError(text, remedy=remedy) from error

    def covers(self, west: float, south: float, east: float, north: float) -> bool:
        """True if the file's bounds contain an area."""
        return (
            self.bounds[0] <= west
            and self.bounds[1] <= south
            and self.bounds[2] >= east
            and self.bounds[3] >= north
        )


def read_map(path: Path) -> MapFile:
    """Read the metadata of a map file; raises `FormatError` if it is not a map file."""
    try:
        if path.exists() and not path.is_file():
            raise ValueError("the path is not a file")
        return _pmtiles(path) if path.suffix.lower() == ".pmtiles" else _mbtiles(path)
    except _DAMAGED as error:
        raise FormatError(
            f"{path.name} is not a map: {_fault_text(error)}",
            remedy="Give an MBTiles or PMTiles file; QGIS makes one with Generate XYZ tiles "
            "(MBTiles)",
        ) from error


def _fault_text(error: BaseException) -> str:
    if isinstance(error, FileNotFoundError):
        return "it does not exist"
    if isinstance(error, sqlite3.Error):
        return "the file is not an MBTiles file, or is damaged"
    return str(error)


def maps_in(directory: Path) -> tuple[MapFile, ...]:
    """Find all map files with picture tiles in a folder; other files are skipped."""
    found = []
    for path in sorted(directory.iterdir()) if directory.is_dir() else []:
        if path.suffix.lower() in SUFFIXES and not path.name.startswith("."):
            with suppress(FormatError):
                found.append(read_map(path))
    return tuple(one for one in found if one.tiles in RASTERS)


def tile_place(latitude_deg: float, longitude_deg: float, zoom: int) -> tuple[float, float]:
    """Column and row of the web Mercator tile at a place, with the fraction inside it."""
    count = float(2**zoom)
    sine = math.sin(math.radians(max(-85.05, min(85.05, latitude_deg))))
    row = (0.5 - math.log((1.0 + sine) / (1.0 - sine)) / (4.0 * math.pi)) * count
    return (longitude_deg + 180.0) / 360.0 * count, row


def tile_corner(column: float, row: float, zoom: int) -> tuple[float, float]:
    """Latitude and longitude [deg] of a tile's north-western corner, by column and row."""
    count = float(2**zoom)
    latitude = math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / count))))
    return latitude, column / count * 360.0 - 180.0


# --------------------------------------------------------------------------- MBTiles


_FACTS = f"SELECT name, value FROM metadata LIMIT {_MOST_FACTS}"
_ZOOM = "SELECT zoom_level FROM tiles ORDER BY zoom_level {} LIMIT 1"


def _mbtiles(path: Path) -> MapFile:
    with _opened(path) as database:
        facts = dict(database.execute(_FACTS).fetchall())
        # An index has either end at once; both together need all tiles.
        ends = [database.execute(_ZOOM.format(order)).fetchone() for order in ("ASC", "DESC")]
    if None in ends:
        raise ValueError("the file has no tiles")
    low, high = (end[0] for end in ends if end is not None)
    said = str(facts.get("format") or "png")
    edges = str(facts.get("bounds") or _EARTH).split(",")
    return MapFile(
        path=path,
        format="mbtiles",
        tiles={"pbf": "mvt", "jpeg": "jpg"}.get(said, said)[:20],
        min_zoom=int(low),
        max_zoom=int(high),
        bounds=_bounds(map(float, edges)),
        attribution=_plain(facts.get("attribution")),
    )


def _bounds(edges: Iterable[float]) -> tuple[float, float, float, float]:
    """Parse west, south, east and north; raises `ValueError` for impossible coordinates."""
    west, south, east, north = edges
    # So that a number that is none is refused, too.
    if not (
        max(abs(south), abs(north)) <= 90.0 and max(abs(west), abs(east)) <= _MOST_LONGITUDE
    ):
        raise ValueError("the map's bounds are not positions on earth")
    return west, south, east, north


def _mbtiles_tile(path: Path, z: int, x: int, y: int) -> bytes | None:
    with _opened(path) as database:
        row = database.execute(
            "SELECT tile_data FROM tiles "
            "WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
            (z, x, 2**z - 1 - y),  # MBTiles counts rows from the south
        ).fetchone()
    return None if row is None else bytes(row[0])


def _opened(path: Path) -> "closing[sqlite3.Connection]":
    """Open a map's database with a limit on queries' time; views in MBTiles may be slow."""
    require_plain_file(path)
    address = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
    database = sqlite3.connect(address, uri=True)
    limit_queries(database, MAP_QUERY_S)
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 2 * MOST_TILE)
    database.execute("PRAGMA trusted_schema=OFF")
    return closing(database)


# --------------------------------------------------------------------------- PMTiles


def _pmtiles(path: Path) -> MapFile:
    header = _header(path)
    facts = {}
    place, length = struct.unpack_from("<2Q", header, 24)
    with suppress(ValueError, OSError, EOFError, RecursionError, zlib.error):
        facts = read_json(_unpacked(_part(path, place, length), header[97]), MAP_PART)
    _check_parts(header, path.stat().st_size)
    return MapFile(
        path=path,
        format="pmtiles",
        tiles=_TYPES.get(header[99], "unknown"),
        min_zoom=header[100],
        max_zoom=header[101],
        bounds=_bounds(value / 1e7 for value in struct.unpack_from("<4i", header, 102)),
        attribution=_plain(facts.get("attribution") if isinstance(facts, dict) else None),
    )


def _header(path: Path) -> bytes:
    require_plain_file(path)
    with path.open("rb") as file:
        header = file.read(_HEADER)
    if header[:8] != b"PMTiles\x03" or len(header) < _HEADER:
        raise ValueError("the file is not PMTiles version 3")
    return header


def _check_parts(header: bytes, size: int) -> None:
    """Check that directories, metadata and tiles end inside the file; raises `ValueError`."""
    parts = struct.unpack_from("<8Q", header, 8)
    if (
        max(place + length for place, length in zip(parts[::2], parts[1::2], strict=True))
        > size
    ):
        raise ValueError("the file is incomplete or damaged")


def _part(path: Path, place: int, length: int, most: int = MAP_PART.bytes) -> bytes:
    if length > most:
        raise ValueError(
            f"a section of the map file has {length} bytes; at most {most} are allowed"
        )
    with path.open("rb") as file:
        file.seek(place)
        return file.read(length)


def _unpacked(content: bytes, compression: int) -> bytes:
    if compression == _NOT_COMPRESSED:
        return content
    if compression != _GZIP:
        raise _OtherCompressionError("the map's index uses a compression other than gzip")
    return zlib.decompressobj(wbits=31).decompress(content, MAP_PART.bytes)


def _pmtiles_tile(path: Path, z: int, x: int, y: int) -> bytes | None:
    header = _header(path)
    root, root_length = struct.unpack_from("<2Q", header, 8)
    (leaves,) = struct.unpack_from("<Q", header, 40)
    (data,) = struct.unpack_from("<Q", header, 56)
    wanted, place, length = _tile_id(z, x, y), root, root_length
    for _ in range(_LEAF_LEVELS):
        found = _entry(_unpacked(_part(path, place, length), header[97]), wanted)
        if found is None:
            return None
        offset, length, run = found
        if run:
            return _part(path, data + offset, length, MOST_TILE)
        place = leaves + offset
    return None


def _tile_id(z: int, x: int, y: int) -> int:
    """PMTiles number of a tile: lower zoom levels first, then along a Hilbert curve."""
    number, side = ((1 << 2 * z) - 1) // 3, (1 << z) // 2
    while side:
        right, below = int(bool(x & side)), int(bool(y & side))
        number += side * side * ((3 * right) ^ below)
        if not below:
            if right:
                x, y = side - 1 - x, side - 1 - y
            x, y = y, x
        side //= 2
    return number


def _entry(directory: bytes, wanted: int) -> tuple[int, int, int] | None:
    """Find a tile in a directory: offset, length and run length (0 for a leaf directory); None
    if it is missing.
    """
    numbers = iter(_varints(directory))
    count = next(numbers, 0)
    if count > len(directory):
        raise ValueError("a tile directory claims more entries than it has bytes")
    tile_ids: list[int] = []
    for _ in range(count):
        tile_ids.append(next(numbers) + (tile_ids[-1] if tile_ids else 0))
    runs = [next(numbers) for _ in range(count)]
    lengths = [next(numbers) for _ in range(count)]
    offsets: list[int] = []
    for place in range(count):
        value = next(numbers)
        # 0: right behind the one before.
        offsets.append(value - 1 if value else offsets[place - 1] + lengths[place - 1])
    at = max((n for n, one in enumerate(tile_ids) if one <= wanted), default=None)
    if at is None or (runs[at] and wanted >= tile_ids[at] + runs[at]):
        return None
    return offsets[at], lengths[at], runs[at]


def _varints(content: bytes) -> list[int]:
    found, value, shift = [], 0, 0
    for byte in content:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            found.append(value)
            value = shift = 0
        elif shift > 63:
            raise ValueError("a number in the tile directory has more than 64 bits")
    return found


def _plain(text: object) -> str | None:
    if not isinstance(text, str):
        return None
    return " ".join(re.sub(r"<[^>]*>|[<>]", " ", text[:_MOST_CREDIT]).split())[:200] or None
