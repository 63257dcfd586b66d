"""Map files that the user put into the folder ``maps``: PMTiles and MBTiles."""

import re
import sqlite3
import struct
from collections.abc import AsyncIterator
from contextlib import closing
from pathlib import Path
from typing import Any

from uavrt.errors import FormatError, RecordingError, UsageError
from uavrt.recording.plain_database import watch

MAX_MAP = 8_000_000_000
SUFFIXES = (".pmtiles", ".mbtiles")
_NAME = re.compile(r"[\w][\w .()-]{0,120}\.(pmtiles|mbtiles)", re.IGNORECASE)
_PMTILES_TYPES = {1: "mvt", 2: "png", 3: "jpg", 4: "webp", 5: "avif"}
_MIME = {
    "mvt": "application/vnd.mapbox-vector-tile",
    "png": "image/png",
    "jpg": "image/jpeg",
    "webp": "image/webp",
}


def map_list(directory: Path) -> list[dict[str, Any]]:
    """List the maps with kind, bounds and zooms; what is none is named with its fault."""
    found = []
    for path in sorted(directory.iterdir()) if directory.is_dir() else []:
        if path.suffix.lower() not in SUFFIXES or not _NAME.fullmatch(path.name):
            continue
        try:
            found.append({"name": path.name, "fault": None, **_facts(path)})
        except (OSError, ValueError, struct.error, sqlite3.Error) as error:
            found.append({"name": path.name, "fault": str(error)})
    return found


def map_path(directory: Path, name: str) -> Path:
    """Get the path of a map.

    Raises
    ------
    UsageError
        There is none of this name; a name with a path in it never is one.
    """
    path = directory / name
    if not _NAME.fullmatch(name) or not path.is_file():
        raise UsageError(f"there is no map {name[:80]!r}")
    return path


async def store_map(directory: Path, name: str, chunks: AsyncIterator[bytes]) -> dict[str, Any]:
    """Write a map file as it comes, whole or not at all; gives its facts.

    Raises
    ------
    UsageError
        The name is none of a map, or the file is too large.
    FormatError
        It is no map.
    RecordingError
        It cannot be written.
    """
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"{name[:80]!r} cannot be a map's name",
            remedy="A map file ends in .pmtiles or .mbtiles",
        )
    part = directory / f".{name}.part{Path(name).suffix}"
    taken = 0
    try:
        with part.open("wb") as file:
            async for chunk in chunks:
                taken += len(chunk)
                if taken > MAX_MAP:
                    raise UsageError(f"{name} is larger than {MAX_MAP // 10**9} GB")
                file.write(chunk)
        facts = _facts(part)
        part.replace(directory / name)
    except (ValueError, struct.error, sqlite3.Error) as error:
        raise FormatError(f"{name} is no map: {error}") from error
    except OSError as error:
        raise RecordingError(f"{name} cannot be kept: {error.strerror}") from error
    finally:
        part.unlink(missing_ok=True)
    return {"name": name, "fault": None, **facts}


def _facts(path: Path) -> dict[str, Any]:
    return _pmtiles(path) if path.suffix.lower() == ".pmtiles" else _mbtiles(path)


def tile(path: Path, z: int, x: int, y: int) -> tuple[bytes, str, str | None] | None:
    """Get a tile of an MBTiles file: content, media type, encoding; None where there is none.

    Raises
    ------
    FormatError
        The file is damaged.
    """
    if z > 30:
        return None
    try:
        with _opened(path) as database:
            row = database.execute(
                "SELECT tile_data FROM tiles "
                "WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                (z, x, 2**z - 1 - y),  # MBTiles counts rows from the south
            ).fetchone()
    except sqlite3.Error as error:
        raise FormatError(f"{path.name} cannot be read: {error}") from error
    if row is None:
        return None
    content = bytes(row[0])
    if content[:2] == b"\x1f\x8b":
        return content, _MIME["mvt"], "gzip"
    return content, _MIME[_kind_of(content)], None


def _kind_of(content: bytes) -> str:
    if content[:4] == b"\x89PNG":
        return "png"
    if content[:2] == b"\xff\xd8":
        return "jpg"
    return "webp" if content[:4] == b"RIFF" else "mvt"


def _pmtiles(path: Path) -> dict[str, Any]:
    """Read the header of a PMTiles file, version 3 (specification §3)."""
    with path.open("rb") as file:
        header = file.read(127)
    if header[:8] != b"PMTiles\x03":
        raise ValueError("not a PMTiles file of version 3")
    kind, low, high = header[99], header[100], header[101]
    bounds = [value / 1e7 for value in struct.unpack_from("<4i", header, 102)]
    return {
        "format": "pmtiles",
        "tiles": _PMTILES_TYPES.get(kind, "unknown"),
        "min_zoom": low,
        "max_zoom": high,
        "bounds": bounds,
    }


def _mbtiles(path: Path) -> dict[str, Any]:
    with _opened(path) as database:
        facts = dict(database.execute("SELECT name, value FROM metadata").fetchall())
        low, high = database.execute(
            "SELECT min(zoom_level), max(zoom_level) FROM tiles"
        ).fetchone()
    if low is None:
        raise ValueError("it holds no tiles")
    kind = {"pbf": "mvt", "jpeg": "jpg"}.get(
        facts.get("format", ""), facts.get("format", "png")
    )
    bounds = [float(part) for part in facts.get("bounds", "-180,-85,180,85").split(",")]
    return {
        "format": "mbtiles",
        "attribution": _plain(facts.get("attribution", "")),
        "tiles": kind,
        "min_zoom": low,
        "max_zoom": high,
        "bounds": bounds,
    }


def _plain(text: str) -> str | None:
    """A text of others without its markup, to be shown below the map."""
    return " ".join(re.sub(r"<[^>]*>|[<>]", " ", text).split())[:200] or None


def _opened(path: Path) -> "closing[sqlite3.Connection]":
    address = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
    database = sqlite3.connect(address, uri=True)
    watch(database)
    return closing(database)
