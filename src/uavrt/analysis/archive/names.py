"""Unique names of flights and recordings: their paths below the searched folder."""

from collections import Counter
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path, PurePosixPath

from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.parquet_tables import FlightRow, RecordingRow
from uavrt.analysis.archive.recordings import Found


def name_flights(
    found: Found,
    recordings: Ledger[RecordingRow],
    flights: Ledger[FlightRow],
    passed_over: Collection[Path] = (),
) -> Found:
    """Give each new flight and recording a unique name; names of finished ones do not change.

    A name that is already used is extended by more of its path, such as ``2024/walk``.
    `recordings` and `flights` contain the finished ones. Names of the skipped copies in
    `passed_over` may be used again.
    """
    rows: list[RecordingRow | FlightRow] = [*recordings.rows, *flights.rows]
    known = {row.path: row.flight for row in rows if Path(row.path) not in passed_over}
    taken = set(known.values())

    alike = Counter(one.flight for one in found.recordings if one.flight_directory is None)

    def own(place: str, name: str) -> str:
        if place in known:
            return known[place]
        if alike[name] > 1:
            name += PurePosixPath(place).suffix
        above = [one for one in PurePosixPath(place).parent.parts if one not in ("/", "..")]
        last = PurePosixPath(name).name
        longer = ("/".join((*above[depth:], last)) for depth in reversed(range(len(above))))
        chosen = next((one for one in (name, *longer) if one not in taken), None)
        number = 2
        while chosen is None or chosen in taken:
            chosen, number = f"{name} {number}", number + 1
        taken.add(chosen)
        known[place] = chosen
        return chosen

    for one in found.recordings:  # a flight of which only recordings are known
        if one.flight_directory is not None and one.name in known:
            known.setdefault(str(one.flight_directory), known[one.name])
    names = {place: own(str(place), name) for place, name in found.flights.items()}
    named = tuple(
        replace(
            one,
            flight=own(one.name, one.flight)
            if one.flight_directory is None
            else names[one.flight_directory],
        )
        for one in found.recordings
    )
    return replace(found, recordings=named, flights=names)
