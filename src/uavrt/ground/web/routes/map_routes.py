"""Background map files in the folder ``maps``: PMTiles and MBTiles."""

import asyncio
import re
from collections.abc import AsyncIterator
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from uavrt.analysis.inputs.map_files import MapFile, read_map
from uavrt.core.errors import FormatError, NotFound, RecordingError, UsageError, os_errors_as
from uavrt.ground.web.routes.routing import answered
from uavrt.ground.web.work.foreign_worker import ForeignWorker

MAX_MAP = 8_000_000_000
_NAME = re.compile(r"[\w][\w .()-]{0,120}\.(pmtiles|mbtiles)", re.IGNORECASE)
_MIME = {
    "mvt": "application/vnd.mapbox-vector-tile",
    "png": "image/png",
    "jpg": "image/jpeg",
    "webp": "image/webp",
}


def map_routes(directory: Path, worker: ForeignWorker) -> list[Route]:
    """Make the routes of map files, which browsers read in parts, and of map tiles."""

    async def map_file(request: Request) -> Any:
        path = map_path(directory, request.path_params["name"])
        return FileResponse(path, media_type="application/octet-stream")

    async def map_tile(request: Request) -> Any:
        place = request.path_params
        path = map_path(directory, place["name"])
        found = await worker.call(tile, path, place["z"], place["x"], place["y"])
        if found is None:
            return Response(status_code=204)
        content, kind, encoding = found
        headers = {"Content-Encoding": encoding} if encoding else {}
        return Response(content, media_type=kind, headers=headers)

    return [
        Route("/maps/{name}", answered(map_file)),
        Route("/maps/{name}/{z:int}/{x:int}/{y:int}", answered(map_tile)),
    ]


def map_paths(directory: Path) -> list[Path]:
    """Paths of the map files in a folder, by name."""
    files = sorted(directory.iterdir()) if directory.is_dir() else []
    return [path for path in files if _NAME.fullmatch(path.name)]


def map_list(directory: Path) -> list[dict[str, Any]]:
    """List the maps with kind, bounds and zoom levels; invalid files with their fault."""
    found = []
    for path in map_paths(directory):
        try:
            found.append({"name": path.name, "fault": None, **_facts(read_map(path))})
        except FormatError as error:
            found.append({"name": path.name, "fault": str(error)})
    return found


def map_path(directory: Path, name: str) -> Path:
    """Path of a map by its name; raises `UsageError`."""
    path = directory / name
    if not _NAME.fullmatch(name) or not path.is_file():
        raise NotFound(f"there is no map file {name[:80]!r}")
    return path


async def store_map(
    directory: Path, name: str, chunks: AsyncIterator[bytes], worker: ForeignWorker
) -> dict[str, Any]:
    """Store an uploaded map file and describe it; an incomplete upload is discarded."""
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"{name[:80]!r} is not a valid name for a map file",
            remedy="Use letters, digits, spaces and . ( ) - _, and end the name in .pmtiles "
            "or .mbtiles",
        )
    taken = 0
    # A folder of its own: errors name the file, and two may come at once.
    with (
        os_errors_as(RecordingError, f"{name} cannot be stored"),
        TemporaryDirectory(prefix=".coming-", dir=directory) as coming,
    ):
        part = Path(coming) / name
        with part.open("wb") as file:
            async for chunk in chunks:
                taken += len(chunk)
                if taken > MAX_MAP:
                    large = (
                        f"{name} is larger than {MAX_MAP // 10**9} GB, the limit for a map file"
                    )
                    raise UsageError(large, remedy="Use a map file of a smaller area")
                await asyncio.to_thread(file.write, chunk)
        facts = _facts(await worker.call(read_map, part))
        part.replace(directory / name)
    return {"name": name, "fault": None, **facts}


def _facts(one: MapFile) -> dict[str, Any]:
    facts = {name: value for name, value in asdict(one).items() if name != "path"}
    return facts | {"bounds": list(one.bounds)}


def tile(path: Path, z: int, x: int, y: int) -> tuple[bytes, str, str | None] | None:
    """Read a tile of an MBTiles file: content, media type, encoding. None if it is missing."""
    content = read_map(path).tile(z, x, y)
    if content is None:
        return None
    if content[:2] == b"\x1f\x8b":
        return content, _MIME["mvt"], "gzip"
    return content, _MIME[_kind_of(content)], None


def _kind_of(content: bytes) -> str:
    if content[:4] == b"\x89PNG":
        return "png"
    if content[:2] == b"\xff\xd8":
        return "jpg"
    return "webp" if content[:4] == b"RIFF" else "mvt"
