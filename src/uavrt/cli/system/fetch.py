"""``uavrt fetch``: copy flights from the drone over the MAVLink link."""

import asyncio
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

from uavrt.cli.options.kinds import Seconds
from uavrt.cli.shown.notices import notice
from uavrt.core.clock import Clock
from uavrt.core.errors import ConfigError
from uavrt.ground.fetch.drone_files import DroneFiles
from uavrt.ground.fetch.flight_list import drone_flights
from uavrt.ground.fetch.ftp_client import (
    MOST_ENTRIES,
    MOST_NESTED,
    FileClient,
    RemoteEntry,
    fetch_file,
    require_room,
)
from uavrt.ground.fetch.sample_files import BAND, CHANNELS, is_samples, sample_part
from uavrt.link.mavlink.sending.signing import read_signing_key

WIFI_BYTES_PER_S, RADIO_BYTES_PER_S = 500e3, 3e3
"""Usual rates of a file transfer by MAVLink FTP, over Wi-Fi and at 57600 baud [bytes/s]."""
SAMPLE_NAMES = {"channels of the tags (--samples)": CHANNELS, "other samples (--all)": BAND}
DEFAULT_ADDRESS = "udpin://127.0.0.1:14550"


def fetch(
    flight: str = "",
    *,
    mavlink: tuple[str, ...] = (),
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("flights"),
    list_only: Annotated[bool, Parameter(name="--list", negative="")] = False,
    samples: Annotated[bool, Parameter(negative="")] = False,
    everything: Annotated[bool, Parameter(name="--all", negative="")] = False,
    timeout: Seconds = 20.0,
    signing_key: Path | None = None,
) -> None:
    """Fetch a flight from the drone by MAVLink FTP, resuming an earlier attempt.

    Parameters
    ----------
    flight
        A flight directory, or a file or directory in it; without it, the newest flight.
    mavlink
        Link to the vehicle, as for `uavrt ground`. With several, the fastest is used, and
        another if it fails.
    output
        Directory to save into; the names below it are those on the drone.
    list_only
        Only list the flights on the drone.
    samples
        Also fetch the kept channels of the tags (iq/channels/), for `uavrt integrate`: 54 MB
        an hour for each channel, best by Wi-Fi.
    everything
        Also fetch all other samples (iq/), which are far larger.
    timeout
        Seconds to wait for the drone.
    signing_key
        The drone's mavlink.signing_key_file.
    """
    if ".." in PurePosixPath(flight).parts:
        raise ConfigError(
            f"{flight!r} points outside the flights directory", remedy="Give a path without .."
        )
    key = None if signing_key is None else read_signing_key(signing_key)
    files = DroneFiles(Clock.start().now_ns, signing_key=key)
    left: tuple[str, ...] = () if everything else (BAND,) if samples else (BAND, CHANNELS)
    addresses = mavlink or (DEFAULT_ADDRESS,)
    asyncio.run(_fetch(files, addresses, flight, output, list_only, left, timeout))


async def _fetch(
    files: DroneFiles,
    addresses: tuple[str, ...],
    flight: str,
    output: Path,
    list_only: bool,
    left: tuple[str, ...],
    timeout_s: float,
) -> None:
    async with files.open(*addresses, timeout_s=timeout_s) as client:
        if list_only:
            for entry in await client.list_directory("/" + flight.strip("/")):
                size = "" if entry.size is None else f"{entry.size:>12}"
                print(f"{size:>12}  {entry.path}{'/' if entry.size is None else ''}")
            if flight:
                await _list_samples(client, flight)
            return
        entries = await _wanted(client, flight, left)
        require_room(entries, output, samples=any(is_samples(one.path) for one in entries))
        await _fetch_all(client, entries, output)


async def _list_samples(client: FileClient, flight: str) -> None:
    path = PurePosixPath("/" + flight.strip("/"))
    entries = await client.list_directory(str(path))
    if not any(entry.size is None and entry.path == f"{path}/iq" for entry in entries):
        return
    tree = await client.tree(f"{path}/iq")
    for name, part in SAMPLE_NAMES.items():
        size = sum(entry.size or 0 for entry in tree.files if sample_part(entry.path) == part)
        if size:
            print(f"{size:>12}  {name}")


async def _wanted(client: FileClient, flight: str, left: tuple[str, ...]) -> list[RemoteEntry]:
    """List the files of a flight, small files first, except the kinds of samples in `left`.

    An empty flight name selects the newest flight.
    """
    path = PurePosixPath("/" + flight.strip("/"))
    if not flight:
        names = await drone_flights(client)
        if not names:
            raise ConfigError(
                "there is no flight on the drone",
                remedy="Record a flight first; `uavrt fetch --list` lists all files",
            )
        path = PurePosixPath("/" + names[-1])
    entries = await client.list_directory(str(path.parent))
    found = [entry for entry in entries if entry.path == str(path)]
    if found and found[0].size is not None:
        return found
    tree = await client.tree(str(path))
    if tree.left_out:
        notice(
            f"{tree.left_out} files or directories left out: more than {MOST_NESTED} deep, or "
            f"after the first {MOST_ENTRIES}"
        )
    files = [one for one in tree.files if sample_part(one.path) not in left]
    _print_samples_left([one for one in tree.files if one not in files])
    return sorted(files, key=lambda entry: entry.size or 0)


def _print_samples_left(entries: list[RemoteEntry]) -> None:
    """Print which samples remain on the drone, and how to fetch them."""
    for part, how in ((CHANNELS, "--samples"), (BAND, "--all")):
        size = sum(entry.size or 0 for entry in entries if sample_part(entry.path) == part)
        if size:
            notice(
                f"{size / 1e6:.1f} MB of samples stay on the drone: fetch them with {how}, by "
                f"Wi-Fi (mavlink.direct_links) in {_duration(size / WIFI_BYTES_PER_S)}, by a "
                f"telemetry radio in {_duration(size / RADIO_BYTES_PER_S)}"
            )


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"about {seconds:.0f} s"
    if seconds < 5_400.0:
        return f"about {seconds / 60.0:.0f} minutes"
    return f"about {seconds / 3_600.0:.0f} hours"


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
    notice(f"{fetched} files fetched, {len(entries) - fetched} were already present")
