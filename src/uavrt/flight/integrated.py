"""Store results of ``uavrt integrate`` in the folder ``integrated/`` of the flight.

The flight's own log is never changed. ``integrated/pulses.jsonl`` contains pulses in the format
of ``uavrt detect``, with the status *integrated*. ``integrated/tags.json`` contains the result
for each tag. ``integrated/folds.json`` contains the energies of the flight, folded at the tag's
interval. A new result for a tag replaces its old result.
"""

import json
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TypeVar

import msgspec

from uavrt.core.atomic_file import write_atomically
from uavrt.core.clock import parse_iso_intervals
from uavrt.core.errors import FormatError, RecordingError, os_errors_as
from uavrt.core.foreign import NOTES, read_file, read_json
from uavrt.core.messages import PulsePose
from uavrt.flight.database.fields import IN_NO_TABLE
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.pulse_files import pulse_record, read_pulse_file

_NO_COLUMN = {IN_NO_TABLE: True}
Ring = tuple[tuple[float, float], ...]
"""Latitudes and longitudes of a closed outline [deg]; the last position equals the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedPart:
    """One of several positions that fit the flight equally well."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Radius of the circle around this position that contains 95 % of the position's
    probability [m]."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchedFor:
    """Tag and settings of a search; a result without a detection is valid only for these."""

    frequency_hz: float
    """Frequency in the tag list [Hz]; the fields from here to `gaps_s` are from the tag
    list."""
    pulse_width_s: float
    pulse_intervals_s: tuple[float, ...]
    interval_uncertainty_s: float
    interval_jitter_s: float
    gaps_s: tuple[float, ...]
    """Times between pulse starts in a coded tag's burst [s]; empty for other tags."""
    frequency_window_hz: float
    """Half-width of the band that was searched, about the tag's listed frequency [Hz]."""
    most_drift: float
    """Largest relative drift of the pulse interval that the search covered."""
    antenna: str
    """Name of the antenna pattern used in the search."""
    antenna_assumed: bool
    """True if the antenna was not specified, so that a pattern was assumed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SilentAround:
    """Area around a flight in which the search would have found the tag, but did not."""

    tag_power_dbm: float
    """Assumed radiated power of the tag [dBm]."""
    probability: float
    """Probability with which the search finds a tag that is in the area."""
    within_m: float | None
    """Distance from the flight up to which the search would have found the tag [m]; None if it
    excludes no place."""
    whole_flight: bool
    """True if the search combined the pulses of the whole flight; False if it searched for
    groups of pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedVerdict:
    """Result of the whole-flight analysis for one tag."""

    tag_id: int
    found: bool
    false_alarm_probability: float
    """Probability that noise alone gives a detection at least this strong."""
    interval_s: float
    frequency_hz: float
    level_db: float | None = None
    """Ratio of the strongest pulse's energy to noise power density [dB]; None: no detection."""
    bearing_deg: float | None = None
    """Bearing from the middle of the flight to the tag [deg]."""
    arc50_deg: float | None = None
    arc95_deg: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    radius50_m: float | None = None
    radius95_m: float | None = None
    places: int = 1
    """Number of equally likely positions, such as mirror images across a straight path."""
    pulses: int = 0
    """Number of pulses in ``pulses.jsonl``, which only the whole-flight analysis found."""
    flights: int = 1
    """Number of flights analysed together; `bearing_deg` is from the middle of all."""
    heard_live: int = 0
    """Number of the detected train's pulses that were already detected during the flight."""
    remarks: str = ""
    """Limitations of the results, such as missing terrain heights."""
    ambiguous: bool = False
    """True if another pulse train on this frequency could be the tag, because the ratio of the
    two intervals is simple, such as 3/2."""
    listened: str = ""
    """Time spans with samples of the tag's channel, as ISO 8601 intervals; empty if unknown."""
    parts: tuple[IntegratedPart, ...] = field(default=(), metadata=_NO_COLUMN)
    """Possible positions, the most likely first; latitude and longitude give their middle."""
    region50: tuple[Ring, ...] = field(default=(), metadata=_NO_COLUMN)
    """Smallest region that contains the tag with a probability of 50 %."""
    region95: tuple[Ring, ...] = field(default=(), metadata=_NO_COLUMN)
    searched: SearchedFor | None = field(default=None, metadata=_NO_COLUMN)
    """Tag and settings of the search; None in results that an earlier version wrote."""
    silent: SilentAround | None = field(default=None, metadata=_NO_COLUMN)
    """Area where the search would have found the tag; None if found or not computed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFold:
    """Energies of a whole flight folded at a tag's interval [standard deviations of noise]."""

    tag_id: int
    interval_s: float
    length_s: float
    """Duration of the flight [s]; the rows of `raster` divide it into equal parts."""
    profile: tuple[float, ...]
    """(columns,) energies summed over the flight, by time within the pulse interval; the
    detected pulse train is in the middle."""
    raster: tuple[tuple[float, ...], ...]
    """(rows, columns) energies; each row is a part of the flight, in order, and each column a
    time within the pulse interval."""


_MOST_TAGS, _MOST_CELLS = 5_000, 100_000
"""Largest number of tags in a flight, and of values in `raster` (usually 30 rows of 100)."""
_LARGEST = sys.float_info.max
_DAMAGED = (OSError, ValueError, TypeError, ArithmeticError, RecursionError)
T = TypeVar("T")


def write_integrated(
    flight: str | os.PathLike[str],
    verdicts: Sequence[IntegratedVerdict],
    pulses: Iterable[PulsePose],
    folds: Sequence[FlightFold] = (),
) -> Path:
    """Write the results for some tags and return their folder; other tags' results stay."""
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
        "Copy the flight to a directory that can be written, or give --no-save",
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
    """Read the results of ``uavrt integrate``; raises `FormatError` if they are damaged.

    The result is empty if the flight was not analysed.
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
            f"{tags} cannot be read: {error}",
            remedy="Remove this file, and run uavrt integrate again",
        ) from error
    return verdicts, read_pulse_file(pulses) if pulses.is_file() else ()


def read_folds(flight: str | os.PathLike[str]) -> tuple[FlightFold, ...]:
    """Read the folded energies of all analysed tags; raises `FormatError` if damaged."""
    path = FlightLayout(Path(flight)).integrated_directory / "folds.json"
    if not path.is_file():
        return ()
    try:
        folds = _records(path, FlightFold)
        for one in folds:
            columns = len(one.profile)
            if not columns or {len(row) for row in one.raster} != {columns}:
                raise ValueError("a table has no columns, or rows of unequal length")
            if columns * len(one.raster) > _MOST_CELLS:
                raise ValueError(f"a table has more than {_MOST_CELLS:,} cells")
            if one.interval_s <= 0.0 or one.length_s <= 0.0:
                raise ValueError("an interval or length is not above 0")
    except _DAMAGED as error:
        raise FormatError(
            f"{path} cannot be read: {error}",
            remedy="Remove this file, and run uavrt integrate again",
        ) from error
    return folds


def _records(path: Path, kind: type[T]) -> tuple[T, ...]:
    """Create records from JSON; fields that only later versions have are ignored."""
    found = read_json(read_file(path, NOTES), NOTES)
    if len(found) > _MOST_TAGS:
        raise ValueError(f"the file has more than {_MOST_TAGS:,} tags")
    level = [found]
    while level:
        inside = [(one.values() if isinstance(one, dict) else one) for one in level]
        values = [value for one in inside for value in one]
        if not all(abs(one) <= _LARGEST for one in values if isinstance(one, int | float)):
            raise ValueError("a number is not finite")
        level = [one for one in values if isinstance(one, list | dict)]
    return msgspec.convert(found, tuple[kind, ...])  # type: ignore[valid-type]
