"""Write and read positions in a flight's notes: take-off, and marks of the operator.

Positions are stored as ordinary notes, so that every reader of a flight shows them::

    home at 35.1782410, -111.6565870
    mark at 35.1790000, -111.6560000: nest seen
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

_PLACE = re.compile(r"(home|mark) at (-?\d{1,2}\.\d+), (-?\d{1,3}\.\d+)(?:: (.*))?", re.DOTALL)

GROUND_NOTE = "recorded by the ground station"
"""Note that marks a flight as recorded by a ground station."""
_VEHICLE = re.compile(r"vehicle \d{1,3}(?:, .{1,60})?", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """Position that the operator marked, with a comment."""

    time_ns: int
    latitude_deg: float
    longitude_deg: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Take-off position and marks that are in a flight's notes."""

    home: tuple[float, float] | None
    """Latitude and longitude of the last take-off in the notes [deg]; None if there is none."""
    marks: tuple[Mark, ...]


def home_note(latitude_deg: float, longitude_deg: float) -> str:
    """Format a note with the take-off position."""
    return f"home at {latitude_deg:.7f}, {longitude_deg:.7f}"


def vehicle_note(system_id: int, name: str = "") -> str:
    """Format a note with the vehicle's number and name."""
    said = f", {name.strip()[:60]}" if name.strip() else ""
    return f"vehicle {system_id}{said}"


def vehicle_of(notes: Iterable[tuple[int, str]]) -> str | None:
    """Number and name of the vehicle according to a flight's notes; None if not in them."""
    found = [text for _, text in notes if _VEHICLE.fullmatch(text)]
    return found[-1].removeprefix("vehicle ") if found else None


def mark_note(latitude_deg: float, longitude_deg: float, text: str = "") -> str:
    """Format a note with a marked position and its remark."""
    said = f": {text.strip()[:200]}" if text.strip() else ""
    return f"mark at {latitude_deg:.7f}, {longitude_deg:.7f}{said}"


def places_of(notes: Iterable[tuple[int, str]]) -> Places:
    """Find take-off and marks in a flight's notes, which are pairs of time [ns] and text."""
    home, marks = None, []
    for time_ns, text in notes:
        found = _PLACE.fullmatch(text)
        if found is None:
            continue
        kind, latitude, longitude, said = found.groups()
        place = float(latitude), float(longitude)
        if abs(place[0]) > 90.0 or abs(place[1]) > 180.0:
            continue
        if kind == "home":
            home = place
        else:
            marks.append(
                Mark(
                    time_ns=time_ns,
                    latitude_deg=place[0],
                    longitude_deg=place[1],
                    text=said or "",
                )
            )
    return Places(home=home, marks=tuple(marks))
