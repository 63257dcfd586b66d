"""Find flights that exist twice, recorded by the drone and by the ground station."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import msgspec

from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.parquet_tables import OUTLINES, FlightRow, RecordingRow
from uavrt.analysis.archive.parquet.seals import read_note, write_note
from uavrt.analysis.archive.recordings import Found, flight_of
from uavrt.analysis.inputs.flight_copies import without_copies
from uavrt.core.errors import FormatError
from uavrt.flight.flight_layout import FlightLayout, Stamp
from uavrt.flight.reading.flight_cache import FlightCache
from uavrt.flight.reading.outline import FlightOutline, read_outline


def copies_of(
    found: Found, recordings: Ledger[RecordingRow], flights: Ledger[FlightRow], output: Path
) -> dict[Path, Path]:
    """Map each superfluous copy of a flight to the copy that is used, which is the one with
    most data.

    Samples count more than pulses. Among equal copies, an earlier run's choice remains. A
    flight with samples but without pulses is never a copy. Copies are recognised as in
    `read_season`.
    """
    known = {row.path: row for row in flights.rows if flights.of(row.path) is row}
    listed = {
        Path(copy): Path(path)
        for path, row in known.items()
        if not FlightLayout(Path(path)).database.is_file()
        for copy in row.copies.splitlines()
    }
    copies = {one: listed[one] for one in found.flights if one in listed}
    groups = _groups({*found.flights, *map(Path, known)} - copies.keys(), output)
    directories = {one.directory for group in groups for one in group}
    searched = {
        flight_of(row.path, directories)
        for row in recordings.rows
        if row.state in ("done", "truncated")
    }
    recorded = {one.flight_directory for one in found.recordings}

    def worth(one: FlightOutline) -> tuple[int, ...]:
        place = one.directory
        has_samples = any(FlightLayout(place).channels_directory.glob("*"))
        return (
            *(place in searched, place in recorded, has_samples),
            *(one.pulses, str(place) in known),
        )

    for flight in groups:
        if len(flight) < 2:
            continue
        counting = max(flight, key=worth)
        copies |= {
            one.directory: counting.directory
            for one in flight
            if one is not counting and (one.pulses or not any(worth(one)[:3]))
        }
    return copies


def without(found: Found, copies: Mapping[Path, Path]) -> tuple[Found, int]:
    """Remove copies of flights and their recordings; return the rest and the number removed."""
    left = replace(
        found,
        recordings=tuple(one for one in found.recordings if one.flight_directory not in copies),
        flights={one: name for one, name in found.flights.items() if one not in copies},
    )
    return left, len(found.flights) - len(left.flights)


def drop_copies(
    copies: Mapping[Path, Path], recordings: Ledger[RecordingRow], flights: Ledger[FlightRow]
) -> None:
    """Delete stored results of copies once the copy in use has a result. Raises `OSError`."""
    gone = {copy for copy, one in copies.items() if flights.of(str(one)) is not None}
    for row in recordings.rows if gone else ():
        of_itself = row.state == "recorded"
        if Path(row.path) in gone or (not of_itself and flight_of(row.path, gone)):
            recordings.drop(row.path)
    for copy in gone:
        flights.drop(str(copy))


class _Kept(msgspec.Struct, frozen=True):
    flights: dict[str, tuple[Stamp, FlightOutline]] = {}  # a struct copies it
    groups: list[list[str]] = []


def _groups(directories: set[Path], output: Path) -> list[list[FlightOutline]]:
    """Group each readable flight with its copies. Groups are cached until a flight changes."""
    kept, found = _kept(output), dict[str, tuple[Stamp, FlightOutline]]()
    known = FlightCache(_outline, kept.flights)
    for directory in map(str, sorted(directories)):
        with suppress(FormatError, OSError):  # named where it is placed
            known.get(directory)
            found[directory] = known.kept[directory]
    if found != kept.flights or not kept.groups:
        flights = without_copies([outline for _, outline in found.values()])
        groups = [[str(one.directory) for one in flight] for flight in flights]
        kept = _Kept(flights=found, groups=groups)
        write_note(output / OUTLINES, msgspec.msgpack.encode(kept))
    return [[kept.flights[name][1] for name in group] for group in kept.groups]


def _outline(directory: str) -> FlightOutline:
    outline = read_outline(directory)
    return replace(outline, info=replace(outline.info, tags=()))


def _kept(output: Path) -> _Kept:
    try:
        return msgspec.msgpack.decode(read_note(output / OUTLINES), type=_Kept)
    except (OSError, FormatError, msgspec.DecodeError):
        return _Kept()
