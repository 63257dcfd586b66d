"""A name of its own for each flight: where two have the same, so much of their paths."""

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath

from uavrt.batch.ledger import Ledger
from uavrt.batch.recordings import Found, Recording, flight_of
from uavrt.batch.stores import is_url
from uavrt.batch.tables import FlightRow, RecordingRow

_Parts = tuple[str, ...]


def name_flights(
    found: Found,
    recordings: Ledger[RecordingRow],
    flights: Ledger[FlightRow],
    passed_over: Collection[Path] = (),
) -> tuple[Found, dict[Path, str]]:
    """Name all flights; one that has a name of its own keeps it, whatever comes later.

    ``2023/walk.wav`` and ``2024/walk.wav`` are ``2023/walk`` and ``2024/walk``. Where an older
    archive calls several flights the same, those that are found get names of their own.

    Parameters
    ----------
    found : Found
        What there is.
    recordings, flights : Ledger
        What is done; rows get the names.
    passed_over : collection of Path
        Copies of flights, whose names are free.

    Returns
    -------
    found : Found
        Recordings with their names.
    names : dict of Path to str
        Of the flights, by directory.
    """
    places = _places(found)
    of_recording = {one.name: _place(one) for one in found.recordings}
    directories = {*found.flights, *passed_over}
    free = {str(one) for one in passed_over}

    def place_of(path: str) -> str:
        directory = flight_of(path, directories)
        return of_recording.get(path) or (path if directory is None else str(directory))

    known: list[RecordingRow | FlightRow] = [*recordings.rows, *flights.rows]
    rows = [(place, row) for row in known if (place := place_of(row.path)) not in free]
    owners: dict[str, set[str]] = defaultdict(set)
    for place, row in rows:
        owners[row.flight].add(place)
    own = {place: name for name, (place, *others) in _listed(owners) if not others}
    fresh = {place: parts for place, parts in places.items() if place not in own}
    taken = {name for name, of in owners.items() if of - fresh.keys()}
    names = own | _shortest(fresh, taken)
    for ledger in (recordings, flights):
        _rename(ledger, {row.path: names.get(place) for place, row in rows})
    named = tuple(replace(one, flight=names[_place(one)]) for one in found.recordings)
    return replace(found, recordings=named), {one: names[str(one)] for one in found.flights}


def _rename(
    ledger: Ledger[RecordingRow] | Ledger[FlightRow], names: Mapping[str, str | None]
) -> None:
    for row in ledger.rows:
        name = names.get(row.path)
        if name is not None and name != row.flight:
            ledger.rename(row, name)  # type: ignore[arg-type]


def _listed(owners: Mapping[str, set[str]]) -> list[tuple[str, list[str]]]:
    return [(name, sorted(of)) for name, of in owners.items()]


def _place(recording: Recording) -> str:
    """What has the name: a flight's directory, else the recording."""
    directory = recording.flight_directory
    return recording.name if directory is None else str(directory)


def _places(found: Found) -> dict[str, _Parts]:
    """The parts of each place's path; endings count where nothing else differs."""
    alone = [one for one in found.recordings if one.flight_directory is None]
    whole = {one.name: _parts(one.name) for one in alone}
    stems = {
        name: (*parts[:-1], PurePosixPath(parts[-1]).stem) for name, parts in whole.items()
    }
    how_many = Counter(stems.values())
    places = {
        name: parts if how_many[parts] == 1 else whole[name] for name, parts in stems.items()
    }
    return places | {str(one): _parts(str(one)) for one in found.flights}


def _parts(name: str) -> _Parts:
    parts = name.split("://", 1)[-1].split("/") if is_url(name) else Path(name).parts[1:]
    return tuple(one for one in parts if one not in ("", ".", ".."))


def _shortest(places: Mapping[str, _Parts], taken: Collection[str]) -> dict[str, str]:
    """So much of each path's end as no other has."""
    depths = dict.fromkeys(places, 1)
    while True:
        names = {place: "/".join(places[place][-depth:]) for place, depth in depths.items()}
        how_many = Counter(names.values())
        deeper = [
            place
            for place, name in names.items()
            if (how_many[name] > 1 or name in taken) and depths[place] < len(places[place])
        ]
        if not deeper:
            return _numbered(names, taken)
        for place in deeper:
            depths[place] += 1


def _numbered(names: Mapping[str, str], taken: Collection[str]) -> dict[str, str]:
    """Tell by a number what whole paths do not tell: the same one in a store and here."""
    used, found = set(taken), {}
    for place, name in sorted(names.items()):
        number, own = 2, name
        while own in used:
            own, number = f"{name} {number}", number + 1
        used.add(own)
        found[place] = own
    return found
