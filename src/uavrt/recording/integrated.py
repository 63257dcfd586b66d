"""Results of ``uavrt integrate``, in the folder ``integrated/`` of the flight.

The flight's own log is never changed. ``integrated/pulses.jsonl`` holds pulses as ``uavrt
detect`` writes them, with the status *integrated*; ``integrated/tags.json`` the verdict on each
tag, ``integrated/folds.json`` the flight folded at its interval. A new verdict on a tag
replaces the old one.
"""

import json
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TypeVar

import msgspec

from uavrt.atomic_file import write_atomically
from uavrt.clock import parse_iso_intervals
from uavrt.errors import FormatError, RecordingError, os_errors_as
from uavrt.foreign import NOTES, read_file, read_json
from uavrt.messages import PulsePose
from uavrt.recording.fields import IN_NO_TABLE
from uavrt.recording.layout import FlightLayout
from uavrt.recording.pulse_files import pulse_record, read_pulse_file

_NO_COLUMN = {IN_NO_TABLE: True}
Ring = tuple[tuple[float, float], ...]
"""Latitudes and longitudes around a part of a region; the last place is the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedPart:
    """One of several places that fit the flight equally well."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Radius that holds 95 % of this part's probability [m]."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchedFor:
    """The tag that was searched for: silence excludes only such a tag."""

    frequency_hz: float
    """Frequency from the tag list [Hz], as the values below."""
    pulse_width_s: float
    pulse_intervals_s: tuple[float, ...]
    interval_uncertainty_s: float
    interval_jitter_s: float
    gaps_s: tuple[float, ...]
    """Gaps between the pulses of a coded tag's burst [s]."""
    frequency_window_hz: float
    """Half-width of the searched band [Hz]."""
    most_drift: float
    """Largest relative change of the interval over the flight."""
    antenna: str
    """Name of the pattern."""
    antenna_assumed: bool
    """Whether the antenna was not specified."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SilentAround:
    """Area that silence excludes around a flight; the map lies next to it."""

    tag_power_dbm: float
    """Assumed radiated power of the tag [dBm]."""
    probability: float
    """Probability with which it would have been found."""
    within_m: float | None
    """Distance from the flight up to which this holds everywhere; None: nowhere."""
    whole_flight: bool
    """Whether the whole flight was judged, rather than groups of pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedVerdict:
    """Verdict of a whole flight on one tag."""

    tag_id: int
    found: bool
    false_alarm_probability: float
    """Probability that noise alone shows as much."""
    interval_s: float
    frequency_hz: float
    level_db: float | None = None
    """Energy over noise of the strongest pulse; this and the place are None if not found."""
    bearing_deg: float | None = None
    """Bearing from the middle of the flight [deg]."""
    arc50_deg: float | None = None
    arc95_deg: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    radius50_m: float | None = None
    radius95_m: float | None = None
    places: int = 1
    """Places that fit equally well: mirror images across a straight path."""
    pulses: int = 0
    """Number of pulses found in hindsight only, in ``pulses.jsonl``."""
    flights: int = 1
    """Flights judged together; the place is then from the middle of all."""
    heard_live: int = 0
    """Number of the train's pulses in the flight's own log; not written again."""
    remarks: str = ""
    """Limits of the figures: another datum, ground without heights."""
    ambiguous: bool = False
    """Whether a train on its frequency may be its own, at a small ratio of its interval."""
    listened: str = ""
    """ISO 8601 intervals with samples of its channel, separated by spaces; empty if unknown."""
    parts: tuple[IntegratedPart, ...] = field(default=(), metadata=_NO_COLUMN)
    """Those places, the likeliest first; `latitude_deg` of several is of their middle."""
    region50: tuple[Ring, ...] = field(default=(), metadata=_NO_COLUMN)
    """Region that holds the tag with 50 %."""
    region95: tuple[Ring, ...] = field(default=(), metadata=_NO_COLUMN)
    searched: SearchedFor | None = field(default=None, metadata=_NO_COLUMN)
    """The tag searched for; None in results of earlier versions."""
    silent: SilentAround | None = field(default=None, metadata=_NO_COLUMN)
    """Area excluded by silence; None if the tag was received, or no map was made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFold:
    """A whole flight folded at a tag's interval, in standard deviations of noise."""

    tag_id: int
    interval_s: float
    length_s: float
    """Length of the flight, over all rows [s]."""
    profile: tuple[float, ...]
    """(columns,) sum over the flight; the train's phase is in the middle."""
    raster: tuple[tuple[float, ...], ...]
    """(rows, columns), the flight's beginning first."""


_MOST_TAGS, _MOST_CELLS = 5_000, 100_000
"""Limits of a flight's tags, and of a fold's cells: some 30 rows of some hundred columns."""
_LARGEST = sys.float_info.max
_DAMAGED = (OSError, ValueError, TypeError, ArithmeticError, RecursionError)
T = TypeVar("T")


def write_integrated(
    flight: str | os.PathLike[str],
    verdicts: Sequence[IntegratedVerdict],
    pulses: Iterable[PulsePose],
    folds: Sequence[FlightFold] = (),
) -> Path:
    """Write the results of some tags into a flight; those of other tags stay.

    Returns the directory of the results. Raises `RecordingError` if it cannot be written,
    `FormatError` if existing results cannot be read.
    """
    judged = {one.tag_id for one in verdicts}
    old_verdicts, old_pulses = read_integrated(flight)
    kept = [one for one in old_verdicts if one.tag_id not in judged]
    every = sorted([*kept, *verdicts], key=lambda one: one.tag_id)
    left = [one for one in old_pulses if one.pulse.tag_id not in judged]
    rows = sorted([*left, *pulses], key=lambda one: one.pulse.start_time_ns)
    pictures = [one for one in read_folds(flight) if one.tag_id not in judged]
    pictures = sorted([*pictures, *folds], key=lambda one: one.tag_id)
    directory = FlightLayout(Path(flight)).integrated_directory
    lines = "".join(json.dumps(pulse_record(one), allow_nan=False) + "\n" for one in rows)
    with os_errors_as(
        RecordingError,
        f"cannot write {directory}",
        "Copy the flight to a writable place, or give --no-save",
    ):
        directory.mkdir(exist_ok=True)
        write_atomically(directory / "pulses.jsonl", lines)
        text = json.dumps([asdict(one) for one in every], allow_nan=False, indent=1) + "\n"
        write_atomically(directory / "tags.json", text)
        text = json.dumps([asdict(one) for one in pictures], allow_nan=False) + "\n"
        write_atomically(directory / "folds.json", text)
    return directory


def read_integrated(
    flight: str | os.PathLike[str],
) -> tuple[tuple[IntegratedVerdict, ...], tuple[PulsePose, ...]]:
    """Read the results of ``uavrt integrate``, if any; raises `FormatError` if damaged."""
    directory = FlightLayout(Path(flight)).integrated_directory
    tags, pulses = directory / "tags.json", directory / "pulses.jsonl"
    if not tags.is_file():
        return (), ()
    try:
        verdicts = _records(tags, IntegratedVerdict)
        for one in verdicts:
            parse_iso_intervals(one.listened)
    except _DAMAGED as error:
        raise FormatError(
            f"{tags} cannot be read: {error}", remedy="Remove it, and integrate again"
        ) from error
    return verdicts, read_pulse_file(pulses) if pulses.is_file() else ()


def read_folds(flight: str | os.PathLike[str]) -> tuple[FlightFold, ...]:
    """Read the folds of the judged tags, if any; raises `FormatError` if damaged."""
    path = FlightLayout(Path(flight)).integrated_directory / "folds.json"
    if not path.is_file():
        return ()
    try:
        folds = _records(path, FlightFold)
        for one in folds:
            columns = len(one.profile)
            if not columns or {len(row) for row in one.raster} != {columns}:
                raise ValueError("no columns, or rows of unequal length")
            if columns * len(one.raster) > _MOST_CELLS:
                raise ValueError(f"more than {_MOST_CELLS:,} cells")
            if one.interval_s <= 0.0 or one.length_s <= 0.0:
                raise ValueError("an interval or a length of zero or less")
    except _DAMAGED as error:
        raise FormatError(
            f"{path} cannot be read: {error}", remedy="Remove it, and integrate again"
        ) from error
    return folds


def _records(path: Path, kind: type[T]) -> tuple[T, ...]:
    """Make records of JSON; fields of later versions are ignored."""
    found = read_json(read_file(path, NOTES), NOTES)
    if len(found) > _MOST_TAGS:
        raise ValueError(f"it has more than {_MOST_TAGS:,} tags")
    level = [found]
    while level:
        inside = [(one.values() if isinstance(one, dict) else one) for one in level]
        values = [value for one in inside for value in one]
        if not all(abs(one) <= _LARGEST for one in values if isinstance(one, int | float)):
            raise ValueError("a number in it is not finite")
        level = [one for one in values if isinstance(one, list | dict)]
    return msgspec.convert(found, tuple[kind, ...])  # type: ignore[valid-type]
