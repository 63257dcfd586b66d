"""What a whole flight said in hindsight, beside the flight: ``integrated/``.

The flight's own log is never changed. ``integrated/pulses.jsonl`` holds pulses as ``uavrt
detect`` writes them, with the status *integrated*; ``integrated/tags.json`` what was found of
each tag, ``integrated/folds.json`` the flight folded at its interval. What is judged again
replaces what was said of that tag before.
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
    """One of the places that a flight cannot tell apart."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Holds 95 % of this part's probability."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchedFor:
    """What was looked for: only of that does a search in vain say that it is not there."""

    frequency_hz: float
    """Of the tag list, as all of the tag below."""
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
    """Nobody told which antenna the drone carried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SilentAround:
    """What a search in vain says of the ground around a flight; the map is beside it."""

    tag_power_dbm: float
    """That the tag is taken to radiate."""
    probability: float
    """With which it would have been found."""
    within_m: float | None
    """So near the flight everywhere; None: nowhere with so much."""
    whole_flight: bool
    """Found by judging the whole flight, else heard by groups of pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedVerdict:
    """What a whole flight says of one tag."""

    tag_id: int
    found: bool
    false_alarm_probability: float
    """That noise alone shows as much."""
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
    """Places that the flight cannot tell apart: mirror images of a straight way."""
    pulses: int = 0
    """Seen in hindsight alone, in ``pulses.jsonl``."""
    flights: int = 1
    """Judged together; the place is then from the middle of all."""
    heard_live: int = 0
    """Of the train's pulses those that the flight's own log has already; not written again."""
    remarks: str = ""
    """What the figures do not hold for: another datum, ground that no file tells."""
    ambiguous: bool = False
    """Whether a train on its frequency may be its own, at a small ratio of its interval."""
    listened: str = ""
    """When there were samples of its channel: intervals of ISO 8601, spaces between. Empty
    where nobody knows: earlier versions did not tell."""
    parts: tuple[IntegratedPart, ...] = field(default=(), metadata=_BESIDE)
    """Those places, the likeliest first. Of several, `latitude_deg` is of their middle."""
    region50: tuple[Ring, ...] = field(default=(), metadata=_BESIDE)
    """Holds the tag with 50 %."""
    region95: tuple[Ring, ...] = field(default=(), metadata=_BESIDE)
    searched: SearchedFor | None = field(default=None, metadata=_BESIDE)
    """None where earlier versions did not tell."""
    silent: SilentAround | None = field(default=None, metadata=_BESIDE)
    """None where it was heard, or nobody asked."""


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
    """Write what was found beside a flight; other tags' results stay.

    `verdicts`: one for each tag that was judged.
    Returns: the directory of the results.
    Raises `RecordingError`: it cannot be written.
    Raises `FormatError`: what is there already cannot be read.
    """
    judged = {one.tag_id for one in verdicts}
    old_verdicts, old_pulses = read_integrated(flight)
    kept = [one for one in old_verdicts if one.tag_id not in judged]
    told = sorted([*kept, *verdicts], key=lambda one: one.tag_id)
    left = [one for one in old_pulses if one.pulse.tag_id not in judged]
    rows = sorted([*left, *pulses], key=lambda one: one.pulse.start_time_ns)
    pictures = [one for one in read_folds(flight) if one.tag_id not in judged]
    pictures = sorted([*pictures, *folds], key=lambda one: one.tag_id)
    directory = FlightLayout(Path(flight)).integrated_directory
    lines = "".join(json.dumps(pulse_record(one), allow_nan=False) + "\n" for one in rows)
    try:
        directory.mkdir(exist_ok=True)
        write_atomically(directory / "pulses.jsonl", lines)
        text = json.dumps([asdict(one) for one in told], allow_nan=False, indent=1) + "\n"
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
    """Read what was found in hindsight; nothing where nobody has looked.

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
    """Read the folds of the tags that were judged; none of what earlier versions judged.

    Raises `FormatError`: the file is damaged.
    """
    path = FlightLayout(Path(flight)).integrated_directory / "folds.json"
    if not path.is_file():
        return ()
    try:
        folds = _records(path, FlightFold)
        for one in folds:
            columns = {len(row) for row in one.raster}
            if (
                columns != {len(one.profile)}
                or len(one.profile) * len(one.raster) > _MOST_CELLS
            ):
                raise ValueError(f"rows of unequal length, or more than {_MOST_CELLS:,} cells")
    except _DAMAGED as error:
        raise FormatError(
            f"{path} cannot be read: {error}", remedy="Remove it, and integrate again"
        ) from error
    return folds


def _records(path: Path, kind: type[T]) -> tuple[T, ...]:
    """Make records of JSON; what a later version wrote beyond them is passed over."""
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
