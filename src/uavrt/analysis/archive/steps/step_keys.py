"""Hash the inputs of each step, which runs again only if they have changed."""

import hashlib
import os
import stat
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import uavrt
from uavrt.analysis.archive.steps.flight_work import FlightTask
from uavrt.core.messages import Tag
from uavrt.flight.flight_layout import FlightLayout

PLACING_STEPS = ("attach", "bearing", "localize")
"""Steps that run together, since each uses the result of the step before it."""


def step_keys(task: FlightTask) -> tuple[dict[str, str], dict[str, str]]:
    """Hashes of the inputs of a flight's steps, for a directional antenna and a monopole.

    They depend on the flight's present files, its pulses and the settings.
    """
    how = task.settings
    asked = [] if how.antenna is None else [Path(how.antenna)]
    estimated = task.track is not None and task.clock_offset_s is None
    attach = _hashed(
        [
            *(task.path, [one.file.stem for one in task.searched]),
            tags_as_read(task.tags) if task.searched else (),
            *(task.clock_offset_s, task.vehicle),
            *(how.antenna if estimated else None, uavrt.__version__),
        ],
        [*flight_files(task), *(asked if estimated else ())],
    )
    bearing = _hashed([attach, how.antenna, how.offset_deg], asked)
    ground: list[object] = [how.dem, how.sea and how.dem is not None]
    elevation = _elevation_files(how.dem)
    integrate = _hashed([attach, how.antenna, *ground], [*asked, *elevation, *_kept(task)])
    heights = (how.height_m, how.height_sigma_m)
    localize, by_power = (
        _hashed([bearing, how.method, power, *ground, read], elevation)
        for power, read in ((False, how.heading_sigma_deg), (True, heights))
    )
    keys = {"attach": attach, "bearing": bearing, "localize": localize, "integrate": integrate}
    return keys, keys | {"localize": by_power}


def recorded_key(task: FlightTask) -> str:
    """Hash of the files with a flight's pulses. Raises `OSError` if they cannot be read."""
    return _hashed([task.path], flight_files(task))


def key_of(path: str, keys: Mapping[str, str]) -> str:
    """Hash of a flight's path and of the input hashes of its steps."""
    return _hashed([path, sorted(keys.items())], [])


def tags_as_read(tags: Iterable[Tag]) -> list[str]:
    """Sorted texts of tags for a hash, without names, on which no result depends."""
    return sorted(repr(replace(tag, name=None)) for tag in tags)


def written(keys: Mapping[str, str]) -> str:
    """Encode steps' hashes as STEP=HASH, separated by commas; `read_keys` decodes them."""
    return ",".join(f"{step}={key}" for step, key in sorted(keys.items()))


def read_keys(text: str) -> dict[str, str]:
    """Decode a text written by `written`; return the hashes by step."""
    return dict(one.split("=", 1) for one in text.split(",") if "=" in one)


def flight_files(task: FlightTask) -> list[Path]:
    """Files with a flight's pulses and poses: database, write-ahead log, separate track."""
    layout = FlightLayout(Path(task.path))
    track = [] if task.track is None else [task.track]
    return [layout.database, layout.write_ahead_log, *track]


def _kept(task: FlightTask) -> list[Path]:
    if not task.is_flight:
        return []
    channels = FlightLayout(Path(task.path)).channels_directory
    with suppress(FileNotFoundError, NotADirectoryError):
        return sorted(channels / one for one in os.listdir(channels) if ".sigmf-" in one)
    return []


def _elevation_files(dem: str | None) -> list[Path]:
    if dem is None:
        return []
    place = Path(dem)
    return sorted(place.iterdir()) if place.is_dir() else [place]


def _hashed(facts: list[object], files: Iterable[Path]) -> str:
    for path in files:
        with suppress(FileNotFoundError, NotADirectoryError):
            about = path.stat()
            # To read a database leaves an empty write-ahead log next to it.
            if stat.S_ISREG(about.st_mode) and about.st_size:
                facts += [str(path), about.st_size, about.st_mtime_ns]
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]
