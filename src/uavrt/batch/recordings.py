"""Find recordings in folders; a manifest says what files do not say themselves."""

import csv
import hashlib
import io
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from uavrt.batch.stores import is_url, list_store, marks_of, open_stored
from uavrt.clock import parse_iso_utc
from uavrt.errors import FormatError, StoreError
from uavrt.foreign import NOTES, read_file
from uavrt.radio import RecordingSource, open_recording
from uavrt.recording import FlightLayout

ENDINGS = (
    *(".cf32", ".cfile", ".fc32", ".cs16", ".sc16", ".cu8", ".cs8", ".ci8"),
    *(".sigmf-meta", ".wav", ".rf64"),
)
TRACK_ENDINGS = (".ulg", ".bin", ".BIN", ".tlog", ".nmea", ".gpx")
MANIFEST_COLUMNS = (
    *("path", "format", "sample_rate_hz", "center_frequency_hz", "start_time"),
    *("track", "clock_offset_s"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording, and what must be told about it."""

    path: Path
    """Of one in a store: a word for it, which no file has."""
    flight: str
    """The flight directory that it lies in; without one the file's name without its ending."""
    format_name: str | None = None
    sample_rate_hz: float | None = None
    center_frequency_hz: float | None = None
    start_time_ns: int | None = None
    url: str | None = None
    """Where it is in an object store."""
    flight_directory: Path | None = None
    track: Path | None = None
    """An autopilot's log or a receiver's track of its time."""
    clock_offset_s: float | None = None
    """By which the recording's clock is ahead of the track's."""

    @property
    def name(self) -> str:
        """What tables call it."""
        return self.url or str(self.path)

    def open(self) -> RecordingSource:
        """Open it.

        Raises
        ------
        FormatError
            It cannot be read, or is not what it is said to be.
        StoreError
            Its store does not answer.
        """
        told = {
            "sample_rate_hz": self.sample_rate_hz,
            "center_frequency_hz": self.center_frequency_hz,
        }
        if self.url is not None:
            return open_stored(
                self.url, self.format_name, start_time_ns=self.start_time_ns, **told
            )
        return open_recording(
            self.path, self.format_name, start_time_ns=self.start_time_ns, **told
        )

    def fingerprint(self) -> str:
        """Tell it from any other, and from itself before it was changed.

        Raises
        ------
        OSError
            It is gone.
        StoreError
            Its store does not answer.
        """
        facts: list[object] = [
            *(self.format_name, self.sample_rate_hz, self.center_frequency_hz),
            self.start_time_ns,
        ]
        if self.url is not None:
            return _hashed([*facts, *marks_of(self.url)])
        for path in (self.path, self.path.with_suffix(".sigmf-data")):
            if path is self.path or path.is_file():
                about = path.stat()
                facts += [str(path.resolve()), about.st_size, about.st_mtime_ns]
        return _hashed(facts)


def flight_of(path: str, flights: Collection[Path]) -> Path | None:
    """Find the flight that a path is of or lies in, whether it is there or not."""
    if not flights or is_url(path):
        return None
    whole = Path(os.path.realpath(path))
    return next((one for one in (whole, *whole.parents) if one in flights), None)


def out_of_reach(error: BaseException) -> bool:
    """Whether what was asked for could not be reached: it may be as it was before."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, StoreError | OSError):
            return True
        cause = cause.__cause__
    return False


def _hashed(facts: list[object]) -> str:
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What there is at and below some paths."""

    recordings: tuple[Recording, ...]
    """By path, each once."""
    flights: tuple[Path, ...] = ()
    """Flight directories, with recordings or without."""
    kept_channels: int = 0
    """Files of kept channels that were passed over."""


def find_recordings(
    paths: Sequence[Path | str], told: Mapping[Path, Recording] | None = None
) -> Found:
    """Get all recordings and flights at and below some paths.

    Channels that a flight kept are passed over: they are parts of what was received.

    Parameters
    ----------
    paths : sequence of Path or str
        Files and folders; addresses in object stores, in which flights are passed over.
    told : mapping of Path to Recording, optional
        What a manifest says, by resolved path.

    Raises
    ------
    FormatError
        A path does not exist.
    StoreError
        A store does not answer.
    """
    known = dict(told or {})
    found: dict[Path, Recording] = {}
    flights: set[Path] = set()
    channels = 0
    for url in (str(one) for one in paths if is_url(str(one))):
        for stored in list_store(url):
            if PurePosixPath(stored).parent.name == "channels" and stored != url:
                channels += 1
            elif stored.lower().endswith(ENDINGS) or stored == url:
                known.setdefault(Path(stored), _recording_at(stored))
    for path in (Path(one).absolute() for one in paths if not is_url(str(one))):
        if not path.exists():
            raise FormatError(f"there is no {path}", remedy="Check the path")
        for file in [path] if path.is_file() else _files(path):
            if path.is_dir() and file.parent.name == "channels":
                channels += 1
            elif file.name == FlightLayout(file.parent).database.name:
                flights.add(file.parent.resolve())
            elif (resolved := file.resolve()) not in known:
                found[resolved] = _recording(file)
    found |= known
    flights |= {one.flight_directory for one in found.values() if one.flight_directory}
    return Found(
        recordings=tuple(found[path] for path in sorted(found)),
        flights=tuple(sorted(flights)),
        kept_channels=channels,
    )


def _files(folder: Path) -> Iterator[Path]:
    database = FlightLayout(folder).database.name
    for directory, below, names in os.walk(folder):
        below.sort()
        for name in names:
            if name.lower().endswith(ENDINGS) or name == database:
                yield Path(directory) / name


def _recording_at(url: str) -> Recording:
    return Recording(path=Path(url), flight=PurePosixPath(url).stem, url=url)


def _recording(file: Path) -> Recording:
    for parent in file.resolve().parents:
        if FlightLayout(parent).database.is_file():
            return Recording(path=file, flight=parent.name, flight_directory=parent)
    tracks = (file.with_suffix(ending) for ending in TRACK_ENDINGS)
    beside = next((track for track in tracks if track.is_file()), None)
    return Recording(path=file, flight=file.stem, track=beside)


def read_manifest(path: Path) -> dict[Path, Recording]:
    """Read what is told of recordings: CSV with the columns of `MANIFEST_COLUMNS`.

    Relative paths are relative to the manifest. Empty cells are not told.

    Raises
    ------
    FormatError
        It cannot be read, or a line is wrong; the line is named.
    """
    remedy = f"A line has {', '.join(MANIFEST_COLUMNS)}; only path must be there"
    found: dict[Path, Recording] = {}
    try:
        text = read_file(path, NOTES).decode("utf-8-sig")
        with io.StringIO(text, newline="") as file:
            lines = csv.DictReader(file)
            if "path" not in (lines.fieldnames or ()):
                raise FormatError(f"{path} has no column path", remedy=remedy)
            if unknown := set(lines.fieldnames or ()) - set(MANIFEST_COLUMNS):
                raise FormatError(
                    f"{path} has a column {min(map(str, unknown))}", remedy=remedy
                )
            for number, line in enumerate(lines, 2):
                try:
                    one = _told(path.absolute().parent, line)
                except (ValueError, TypeError) as error:
                    raise FormatError(
                        f"{path}, line {number}: {error}", remedy=remedy
                    ) from error
                if one.url is None and not one.path.is_file():
                    raise FormatError(
                        f"{path}, line {number}: there is no {one.path}", remedy=remedy
                    )
                found[one.path if one.url else one.path.resolve()] = one
    except (OSError, UnicodeError, csv.Error) as error:
        raise FormatError(f"cannot read {path}: {error}", remedy="Check the path") from error
    return found


def _told(folder: Path, line: Mapping[str, str | None]) -> Recording:
    told = {name: (line.get(name) or "").strip() for name in MANIFEST_COLUMNS}
    if not told["path"]:
        raise ValueError("no path")
    stored = is_url(told["path"])
    one = _recording_at(told["path"]) if stored else _recording(folder / told["path"])
    track = folder / told["track"] if told["track"] else one.track
    if track is not None and not track.is_file():
        raise ValueError(f"there is no {track}")
    return replace(
        one,
        format_name=told["format"] or None,
        sample_rate_hz=_number(told["sample_rate_hz"]),
        center_frequency_hz=_number(told["center_frequency_hz"]),
        start_time_ns=parse_iso_utc(told["start_time"]) if told["start_time"] else None,
        track=track,
        clock_offset_s=_number(told["clock_offset_s"]),
    )


def _number(text: str) -> float | None:
    return float(text) if text else None
