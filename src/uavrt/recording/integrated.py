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
from uavrt.errors import FormatError, RecordingError
from uavrt.foreign import NOTES, read_file, read_json
from uavrt.messages import PulsePose
from uavrt.recording.fields import IN_NO_TABLE
from uavrt.recording.layout import FlightLayout
from uavrt.recording.pulse_files import pulse_record, read_pulse_file

_BESIDE = {IN_NO_TABLE: True}
Ring = tuple[tuple[float, float], ...]
"""Latitudes and longitudes around a part of a region; the last place is the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedPart:
    """One of several places that fit the flight equally well."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Holds 95 % of this part's probability."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchedFor:
    """The tag that was searched for: silence excludes only such a tag."""

    frequency_hz: float
    """From the tag list, as the values below."""
    pulse_width_s: float
    pulse_intervals_s: tuple[float, ...]
    interval_uncertainty_s: float
    interval_jitter_s: float
    gaps_s: tuple[float, ...]
    """Between the pulses of a coded tag's burst."""
    frequency_window_hz: float
    """Half-width of the search around it."""
    most_drift: float
    """Largest relative change of the interval over the flight."""
    antenna: str
    """Name of the pattern."""
    antenna_assumed: bool
    """The antenna was not specified."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SilentAround:
    """What silence excludes on the ground around a flight; the map lies next to it."""

    tag_power_dbm: float
    """Power that the tag is assumed to radiate."""
    probability: float
    """Probability with which it would have been found."""
    within_m: float | None
    """Distance from the flight up to which this holds everywhere; None: nowhere."""
    whole_flight: bool
    """Found by judging the whole flight, else heard by groups of pulses."""


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
    """From the middle of the flight."""
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
    """Judged together; the place is then from the middle of all."""
    heard_live: int = 0
    """Of the train's pulses those that the flight's own log has already; not written again."""
    remarks: str = ""
    """Limits of the figures: another datum, ground without heights."""
    ambiguous: bool = False
    """Whether a train on its frequency may be its own, at a small ratio of its interval."""
    listened: str = ""
    """When there were samples of its channel: intervals of ISO 8601, spaces between. Empty
    where unknown, as in results of earlier versions."""
    parts: tuple[IntegratedPart, ...] = field(default=(), metadata=_BESIDE)
    """Those places, the likeliest first. Of several, `latitude_deg` is of their middle."""
    region50: tuple[Ring, ...] = field(default=(), metadata=_BESIDE)
    """Holds the tag with 50 %."""
    region95: tuple[Ring, ...] = field(default=(), metadata=_BESIDE)
    searched: SearchedFor | None = field(default=None, metadata=_BESIDE)
    """None in results of earlier versions."""
    silent: SilentAround | None = field(default=None, metadata=_BESIDE)
    """None where the tag was heard, or no map was made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFold:
    """A whole flight folded at a tag's interval, in standard deviations of noise."""

    tag_id: int
    interval_s: float
    length_s: float
    """Of the flight, over all rows."""
    profile: tuple[float, ...]
    """(columns,) sum over the flight; the train's phase is in the middle."""
    raster: tuple[tuple[float, ...], ...]
    """(rows, columns), the flight's beginning first."""


_MOST_TAGS, _MOST_CELLS = 5_000, 100_000
"""Of a flight, and of a tag's fold: some 30 rows of some hundred columns."""
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

    `verdicts`: one for each tag that was judged.
    Returns: the directory of the results.
    Raises `RecordingError`: it cannot be written.
    Raises `FormatError`: what is there already cannot be read.
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
    try:
        directory.mkdir(exist_ok=True)
        write_atomically(directory / "pulses.jsonl", lines)
        text = json.dumps([asdict(one) for one in every], allow_nan=False, indent=1) + "\n"
        write_atomically(directory / "tags.json", text)
        text = json.dumps([asdict(one) for one in pictures], allow_nan=False) + "\n"
        write_atomically(directory / "folds.json", text)
    except OSError as error:
        raise RecordingError(
            f"cannot write {directory}: {error.strerror}",
            remedy="Copy the flight to a writable place, or give --no-save",
        ) from error
    return directory


def read_integrated(
    flight: str | os.PathLike[str],
) -> tuple[tuple[IntegratedVerdict, ...], tuple[PulsePose, ...]]:
    """Read the results of ``uavrt integrate``; empty where there are none.

    Raises `FormatError`: the files are damaged.
    """
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
    """Read the folds of the judged tags; earlier versions wrote none.

    Raises `FormatError`: the file is damaged.
    """
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
