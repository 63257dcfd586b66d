"""``uavrt fetch``: flights from the drone, over the MAVLink link."""

import asyncio
import math
import sys
from pathlib import Path, PurePosixPath
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)

from uavrt.clock import Clock
from uavrt.errors import ConfigError
from uavrt.ground.drone_files import DroneFiles
from uavrt.ground.fetch import (
    MOST_DEEP,
    MOST_ENTRIES,
    FileClient,
    RemoteEntry,
    fetch_file,
    require_room,
)
from uavrt.mavlink.signing import read_signing_key

DEFAULT_ADDRESS = "udpin://127.0.0.1:14550"


def fetch(
    flight: str = "",
    *,
    mavlink: tuple[str, ...] = (),
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("flights"),
    list_only: Annotated[bool, Parameter(name="--list", negative="")] = False,
    everything: Annotated[bool, Parameter(name="--all", negative="")] = False,
    timeout: float = 20.0,
    signing_key: Path | None = None,
) -> None:
    """Fetch a flight from the drone by MAVLink FTP; go on where an earlier attempt ended.

    Parameters
    ----------
    flight
        A flight directory, or a file or directory in it; without it, the newest flight.
    mavlink
        Link to the vehicle, as for `uavrt ground`. Of several the quickest is taken, and
        another when that is cut.
    output
        Where to put it; directories are made like those on the drone.
    list_only
        Only show what is there.
    everything
        Recorded samples too (iq/); without it they stay on the drone, for their size.
    timeout
        Seconds to wait for the drone.
    signing_key
        Key file that the drone has as mavlink.signing_key_file.
    """
    if ".." in PurePosixPath(flight).parts:
        raise ConfigError(f"{flight!r} leads out of the flights", remedy="Leave out the ..")
    if not 0.0 < timeout < math.inf:
        raise ConfigError(f"a timeout of {timeout} s", remedy="Give --timeout in seconds")
    key = None if signing_key is None else read_signing_key(signing_key)
    files = DroneFiles(Clock.start().now_ns, signing_key=key)
    addresses = mavlink or (DEFAULT_ADDRESS,)
    asyncio.run(_fetch(files, addresses, flight, output, list_only, everything, timeout))


async def _fetch(
    files: DroneFiles,
    addresses: tuple[str, ...],
    flight: str,
    output: Path,
    list_only: bool,
    everything: bool,
    timeout_s: float,
) -> None:
    async with files.open(*addresses, timeout_s=timeout_s) as client:
        if list_only:
            for entry in await client.list_directory("/" + flight.strip("/")):
                size = "" if entry.size is None else f"{entry.size:>12}"
                print(f"{size:>12}  {entry.path}{'/' if entry.size is None else ''}")
            return
        entries = await _wanted(client, flight, everything)
        require_room(entries, output, samples=any("/iq/" in one.path for one in entries))
        await _fetch_all(client, entries, output)


async def _wanted(client: FileClient, flight: str, everything: bool) -> list[RemoteEntry]:
    """Files of a flight, the newest when none is named; small ones first."""
    path = PurePosixPath("/" + flight.strip("/"))
    if not flight:
        flights = [e.path for e in await client.list_directory("/") if e.size is None]
        names = sorted(p for p in flights if PurePosixPath(p).name.startswith("flight_log_"))
        if not names:
            raise ConfigError(
                "there is no flight on the drone", remedy="`uavrt fetch --list` shows what is"
            )
        path = PurePosixPath(names[-1])
    beside = await client.list_directory(str(path.parent))
    found = [entry for entry in beside if entry.path == str(path)]
    if found and found[0].size is not None:
        return found
    tree = await client.tree(str(path))
    if tree.left_out:
        print(
            f"{tree.left_out} files or directories left out: more than {MOST_DEEP} deep, or "
            f"after the first {MOST_ENTRIES}",
            file=sys.stderr,
        )
    files = [f for f in tree.files if everything or "/iq/" not in f.path]
    return sorted(files, key=lambda entry: entry.size or 0)


async def _fetch_all(client: FileClient, entries: list[RemoteEntry], output: Path) -> None:
    progress = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    fetched = 0
    with progress:
        for entry in entries:
            name = entry.path.lstrip("/")
            task = progress.add_task(name, total=entry.size)

            def show(done: int, size: int, task=task) -> None:  # type: ignore[no-untyped-def]
                progress.update(task, completed=done, total=size)

            fetched += await fetch_file(client, entry, output / name, show)
    print(f"{fetched} files fetched, {len(entries) - fetched} were here", file=sys.stderr)
