"""Copy flights to a drive, or remove flights. A caller can stop both at any time."""

import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from uavrt.core.errors import RecordingError
from uavrt.core.log import get_logger

log = get_logger()

Step = Callable[[int, int, str], None]
Wanted = Callable[[], bool]

CHUNK_BYTES = 1 << 20
SYNC_BYTES = 8 * CHUNK_BYTES
"""Most data that may wait to be written to the drive [bytes]. A process cannot end before the
kernel has written them; a slow flash drive writes 5 MB/s."""


def save_flights(flights: list[Path], target: Path, step: Step, wanted: Wanted) -> None:
    """Copy flights to a drive, except files that are already there with equal size and date."""
    for done, flight in enumerate(flights):
        step(done, len(flights), flight.name)
        for source in sorted(flight.rglob("*")):
            place = target / flight.name / source.relative_to(flight)
            if source.is_dir():
                place.mkdir(parents=True, exist_ok=True)
            elif source.is_file() and not _is_there(source, place):
                place.parent.mkdir(parents=True, exist_ok=True)
                _copy(source, place, wanted)
    step(len(flights), len(flights), "writing to the drive")
    os.sync()  # so that the drive may be pulled out


def remove_flights(flights: list[Path], step: Step, wanted: Wanted) -> None:
    """Delete flights. Raises `OSError` on a disk fault, `RecordingError` if stopped."""
    for done, flight in enumerate(flights):
        _check(wanted)
        step(done, len(flights), flight.name)
        shutil.rmtree(flight)
        log.info("flight removed", flight=flight.name)


def _check(wanted: Wanted) -> None:
    if not wanted():
        raise RecordingError(
            "the command was stopped because uavrt is shutting down",
            remedy="Send the command again",
        )


def _is_there(source: Path, place: Path) -> bool:
    with suppress(FileNotFoundError):
        before, after = source.stat(), place.stat()
        # FAT keeps times to 2 s.
        return before.st_size == after.st_size and before.st_mtime - after.st_mtime < 2.0
    return False


def _copy(source: Path, place: Path, wanted: Wanted) -> None:
    """Copy a file by a temporary name, so that a removed drive holds no incomplete file."""
    part = place.with_name(place.name + ".part")
    try:
        _copy_content(source, part, wanted)
        shutil.copystat(source, part)
        part.replace(place)
    except BaseException:
        with suppress(OSError):  # the drive may be gone
            part.unlink()
        raise


def _copy_content(source: Path, part: Path, wanted: Wanted) -> None:
    unwritten = 0
    with source.open("rb") as reader, part.open("wb") as writer:
        while True:
            _check(wanted)
            chunk = reader.read(CHUNK_BYTES)
            if not chunk:
                return
            writer.write(chunk)
            unwritten += len(chunk)
            if unwritten >= SYNC_BYTES:
                writer.flush()
                os.fdatasync(writer.fileno())
                unwritten = 0
