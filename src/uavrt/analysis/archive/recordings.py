"""Find recordings in folders; a manifest (CSV file) adds metadata that they lack."""

import csv
import hashlib
import io
import os
import stat
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

from uavrt.analysis.archive.object_stores import is_url, list_store, open_stored, version_of
from uavrt.analysis.archive.parquet.parquet_tables import DONE, RECORDINGS
from uavrt.core.clock import parse_iso_utc
from uavrt.core.errors import FormatError, StoreError
from uavrt.core.foreign import NOTES, read_file
from uavrt.flight.flight_layout import FlightLayout
from uavrt.radio.files.recording_source import RecordingSource
from uavrt.radio.opening import open_recording, reveals_format

TRACK_ENDINGS = (".ulg", ".bin", ".BIN", ".tlog", ".nmea", ".gpx")
MANIFEST_COLUMNS = (
    *("path", "format", "sample_rate_hz", "center_frequency_hz", "start_time"),
    *("track", "clock_offset_s", "vehicle"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording to be searched, with metadata from a manifest where the file lacks them."""

    path: Path
    """Path of the file. For a recording in an object store, it is a placeholder (see `url`)."""
    flight: str
    """Name of the flight, relative to the searched folder: that of its directory or, outside
    flights, that of the recording without extension."""
    format_name: str | None = None
    sample_rate_hz: float | None = None
    center_frequency_hz: float | None = None
    start_time_ns: int | None = None
    url: str | None = None
    """Address of the recording in an object store; None for a local file."""
    flight_directory: Path | None = None
    track: Path | None = None
    """Autopilot log or GPS track recorded at the same time; None if there is none."""
    clock_offset_s: float | None = None
    """Offset of the recording's clock from the track's clock [s], positive if the recording's
    clock is ahead; None if unknown."""
    vehicle: int | None = None
    """MAVLink system id of the vehicle of the track; None for the only one."""

    @property
    def name(self) -> str:
        """Name of the recording in tables: its path or address."""
        return self.url or str(self.path)

    def open(self) -> RecordingSource:
        """Open the recording. Raises `FormatError`, or `StoreError` if an object store
        fails.
        """
        if self.url is not None:
            return open_stored(self.url, **self._stated())
        return open_recording(self.path, **self._stated())

    def _stated(self) -> dict[str, Any]:
        """Metadata from the manifest, as keyword arguments of `open_recording`."""
        names = ("format_name", "sample_rate_hz", "center_frequency_hz", "start_time_ns")
        return {name: getattr(self, name) for name in names}

    def fingerprint(self) -> str:
        """Hash of path, size, time and manifest entry; raises `OSError` or `StoreError`."""
        facts: list[object] = [*self._stated().values()]
        if self.url is not None:
            return _hashed([*facts, *version_of(self.url)])
        for path in (self.path, self.path.with_suffix(".sigmf-data")):
            if path is self.path or path.is_file():
                about = path.stat()
                facts += [str(path.resolve()), about.st_size, about.st_mtime_ns]
        return _hashed(facts)


def flight_of(path: str, flights: Collection[Path]) -> Path | None:
    """Flight directory that contains a path, even a deleted one; None if no flight does."""
    if not flights or is_url(path):
        return None
    whole = Path(os.path.realpath(path))
    return next((one for one in (whole, *whole.parents) if one in flights), None)


def out_of_reach(error: BaseException) -> bool:
    """True if an error came from disk or network; the recording may then be intact."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, StoreError | OSError):
            return True
        cause = cause.__cause__
    return False


def _hashed(facts: list[object]) -> str:
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedFile:
    """A file below a searched path that is not a recording, and the reason."""

    path: str
    reason: str
    unreadable: bool = False
    """True if the file may contain recordings but cannot be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """Recordings, flights and other files found at and below some paths."""

    recordings: tuple[Recording, ...]
    """Recordings in order of path, each once."""
    flights: Mapping[Path, str] = field(default_factory=dict)
    """Flight directories, with and without recordings, and their names."""
    kept_channels: int = 0
    """Number of files that contain one recorded radio channel each; they are not searched."""
    passed_over: tuple[SkippedFile, ...] = ()
    """Files that are neither a recording nor part of a flight or a recording."""


NO_RECORDING = "the file name is not that of a recording (list the file in --manifest)"
_LONE_DATA = "its .sigmf-meta is missing"
_LINK = "a link to a folder (name the folder itself)"
_NO_TEXT = "the file name is not UTF-8 text (rename the file)"
"""Reason for skipping a file whose name cannot be written into a table."""


def find_recordings(
    paths: Sequence[Path | str],
    manifest: Mapping[Path, Recording] | None = None,
    *,
    known: Collection[Path] = (),
) -> Found:
    """Find all recordings and flights at and below some paths, and list all other files.

    Files of single radio channels recorded in flight, and the output of a batch, are skipped.

    Parameters
    ----------
    paths : sequence of Path or str
        Files and folders; addresses in object stores, in which flights are skipped.
    manifest : mapping of Path to Recording, optional
        Entries of a manifest (`read_manifest`), by resolved path.
    known : collection of Path
        Files with another purpose, such as the manifest itself.

    Raises
    ------
    FormatError
        A path does not exist.
    StoreError
        A store does not answer.
    """
    search = _Search(manifest or {}, {_resolved(one) for one in known})
    for one in paths:
        if is_url(str(one)):
            search.store(str(one))
        else:
            search.path(Path(one).absolute())
    return search.found()


class _Search:
    def __init__(self, listed: Mapping[Path, Recording], known: set[Path]) -> None:
        self._listed, self._known = dict(listed), known
        self._recordings: dict[Path, Recording] = {}
        self._flights: dict[Path, str] = {}
        self._passed_over: list[SkippedFile] = []
        self._channels = 0

    def found(self) -> Found:
        recordings = self._recordings | self._listed
        for one in recordings.values():
            if one.flight_directory is not None:
                self._flights.setdefault(one.flight_directory, one.flight)
        tracks = {str(one.track) for one in recordings.values()}
        return Found(
            recordings=tuple(recordings[path] for path in sorted(recordings)),
            flights={path: self._flights[path] for path in sorted(self._flights)},
            kept_channels=self._channels,
            passed_over=tuple(one for one in self._passed_over if one.path not in tracks),
        )

    def store(self, url: str) -> None:
        for stored in list_store(url):
            place = PurePosixPath(stored)
            if place.parent.name == "channels" and stored != url:
                self._channels += 1
            elif stored == url or (reveals_format(place) and place.suffix != ".sigmf-data"):
                name = stored.removeprefix(url.rstrip("/")).strip("/") or place.name
                one = replace(_recording_at(stored), flight=_stem(name))
                self._listed.setdefault(Path(stored), one)
            elif place.suffix != ".sigmf-data":
                self._pass_over(stored, NO_RECORDING)

    def path(self, root: Path) -> None:
        try:
            is_folder = stat.S_ISDIR(root.stat().st_mode)
        except FileNotFoundError as error:
            raise FormatError(f"{root} does not exist", remedy="Check the path") from error
        except OSError as error:
            raise FormatError(
                f"{root} cannot be read: {error.strerror}", remedy="Check its permissions"
            ) from error
        if not self._is_text(root):
            return
        if not is_folder:
            if root.name == FlightLayout(root.parent).database.name:
                self._add_flight(root.parent, root.parent)
            else:
                self._add_recording(root, root.parent)
            return
        for folder, below, names in os.walk(root, onerror=self._unreadable):
            here = Path(folder)
            if RECORDINGS in names and DONE in below:
                below.clear()  # the output of a batch
                continue
            for named in (below, names):
                named[:] = sorted(name for name in named if self._is_text(here / name))
            for name in [one for one in below if (here / one).is_symlink()]:
                self._pass_over(str(here / name), _LINK, unreadable=True)
            for name in names:
                self._add(here / name, root)

    def _is_text(self, path: Path) -> bool:
        """True if a path is valid UTF-8; any other path is recorded as skipped."""
        text = os.fsencode(path).decode(errors="backslashreplace")
        if text != str(path):
            self._pass_over(text, _NO_TEXT, unreadable=True)
        return text == str(path)

    def _add(self, file: Path, root: Path) -> None:
        kept = self._listed.keys() | self._known
        if file.name == FlightLayout(file.parent).database.name:
            self._add_flight(file.parent, root)
        elif file.parent.name == "channels":
            self._channels += 1
        elif self._listed and (one := self._listed.get(resolved := _resolved(file))):
            self._listed[resolved] = replace(one, flight=_name(one, file, root))
        elif not reveals_format(file):
            if _resolved(file) not in kept and _flight_above(file) is None:
                self._pass_over(str(file), NO_RECORDING)
        elif file.suffix == ".sigmf-data":
            if not file.with_suffix(".sigmf-meta").exists():
                self._pass_over(str(file), _LONE_DATA, unreadable=True)
        else:
            self._add_recording(file, root)

    def _add_recording(self, file: Path, root: Path) -> None:
        if (resolved := _resolved(file)) not in self._listed:
            one = _recording(file)
            self._recordings[resolved] = replace(one, flight=_name(one, file, root))

    def _add_flight(self, directory: Path, root: Path) -> None:
        self._flights[_resolved(directory)] = _below(directory, root, directory.name)

    def _unreadable(self, error: OSError) -> None:
        reason = f"cannot be read: {error.strerror}"
        self._pass_over(str(error.filename), reason, unreadable=True)

    def _pass_over(self, path: str, reason: str, *, unreadable: bool = False) -> None:
        self._passed_over.append(SkippedFile(path=path, reason=reason, unreadable=unreadable))


def _name(one: Recording, file: Path, root: Path) -> str:
    return _below(one.flight_directory or file, root, one.flight)


def _below(place: Path, root: Path, else_name: str) -> str:
    within = place != root and place.is_relative_to(root)
    name = place.relative_to(root).as_posix() if within else else_name
    return name if place.is_dir() else _stem(name)


def _stem(name: str) -> str:
    return str(PurePosixPath(name).with_suffix(""))


def _resolved(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _flight_above(file: Path) -> Path | None:
    places = _resolved(file).parents
    return next((one for one in places if _is_flight(one)), None)


@lru_cache(maxsize=4096)
def _is_flight(directory: Path) -> bool:
    return FlightLayout(directory).database.is_file()


def _recording_at(url: str) -> Recording:
    return Recording(path=Path(url), flight=PurePosixPath(url).stem, url=url)


def _recording(file: Path) -> Recording:
    if (flight := _flight_above(file)) is not None:
        return Recording(path=file, flight=flight.name, flight_directory=flight)
    tracks = (file.with_suffix(ending) for ending in TRACK_ENDINGS)
    track_path = next((track for track in tracks if track.is_file()), None)
    return Recording(path=file, flight=file.stem, track=track_path)


def read_manifest(path: Path) -> dict[Path, Recording]:
    """Read a manifest of recordings: a CSV file with the columns of `MANIFEST_COLUMNS`.

    Relative paths are relative to the manifest's folder. Empty cells are unknown values.
    """
    remedy = f"The columns are {', '.join(MANIFEST_COLUMNS)}; only path is required"
    found: dict[Path, Recording] = {}
    try:
        text = read_file(path, NOTES).decode("utf-8-sig")
        with io.StringIO(text, newline="") as file:
            lines = csv.DictReader(file)
            if "path" not in (lines.fieldnames or ()):
                raise FormatError(f"{path} has no column named path", remedy=remedy)
            if unknown := set(lines.fieldnames or ()) - set(MANIFEST_COLUMNS):
                raise FormatError(
                    f"{path} has an unknown column {min(map(str, unknown))}", remedy=remedy
                )
            for number, line in enumerate(lines, 2):
                try:
                    one = _recording_of(path.absolute().parent, line)
                except (ValueError, TypeError) as error:
                    raise FormatError(
                        f"{path}, line {number}: {error}", remedy=remedy
                    ) from error
                if one.url is None and not one.path.is_file():
                    raise FormatError(
                        f"{path}, line {number}: {one.path} does not exist", remedy=remedy
                    )
                found[one.path if one.url else one.path.resolve()] = one
    except (OSError, UnicodeError, csv.Error) as error:
        raise FormatError(f"cannot read {path}: {error}", remedy="Check the path") from error
    return found


def _recording_of(folder: Path, line: Mapping[str, str | None]) -> Recording:
    cells = {name: (line.get(name) or "").strip() for name in MANIFEST_COLUMNS}
    if not cells["path"]:
        raise ValueError("the path is missing")
    stored = is_url(cells["path"])
    one = _recording_at(cells["path"]) if stored else _recording(folder / cells["path"])
    track = folder / cells["track"] if cells["track"] else one.track
    if track is not None and not track.is_file():
        raise ValueError(f"{track} does not exist")
    return replace(
        one,
        format_name=cells["format"] or None,
        sample_rate_hz=_number(cells["sample_rate_hz"]),
        center_frequency_hz=_number(cells["center_frequency_hz"]),
        start_time_ns=parse_iso_utc(cells["start_time"]) if cells["start_time"] else None,
        track=track,
        clock_offset_s=_number(cells["clock_offset_s"]),
        vehicle=int(cells["vehicle"]) if cells["vehicle"] else None,
    )


def _number(text: str) -> float | None:
    return float(text) if text else None
