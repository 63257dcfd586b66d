"""A flight in outline, for summaries of many: no pulse is read as an object."""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uavrt.messages import FlightInfo
from uavrt.recording.flight_reader import LATEST_NS, flight_database, flight_info
from uavrt.recording.places import GROUND_NOTE, vehicle_of

_BATTERY = re.compile(r"battery (\d{1,3}) %")
_COUNTED = "detection_status = 'confirmed' AND ghost_of_tag_id IS NULL"
_HEARD = (
    f"SELECT tag_id, count(*) FILTER (WHERE {_COUNTED}),"
    f" min(start_time_ns) FILTER (WHERE {_COUNTED}),"
    f" max(start_time_ns) FILTER (WHERE {_COUNTED}), max(end_time_ns)"
    " FROM pulses GROUP BY tag_id"
)
"""Of each tag, and the end of its last pulse of any status; the table is read once."""
_LEVELS = (
    "SELECT tag_id, start_time_ns, snr_db FROM pulses WHERE detection_status = 'confirmed'"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeardTag:
    """What a flight heard of one tag: confirmed pulses that are no ghosts."""

    pulses: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOutline:
    """A flight's length, what it heard, and its battery."""

    info: FlightInfo
    end_time_ns: int
    """Of the last that is recorded."""
    heard: dict[int, HeardTag]
    of_ground: bool
    """A ground station recorded it as it was received; else it is the drone's own."""
    vehicle: str | None
    """Number and name, where a ground station wrote them."""
    battery_percent: tuple[int, ...]
    """As the ground station noted it, in order of time."""

    @property
    def pulses(self) -> int:
        """How many were confirmed, of all tags."""
        return sum(one.pulses for one in self.heard.values())

    @property
    def directory(self) -> Path:
        """Where it lies."""
        return Path(self.info.directory)


def read_outline(directory: str | os.PathLike[str]) -> FlightOutline:
    """Read a flight in outline.

    Raises `FormatError`: there is no flight, or its database is damaged.
    """
    with flight_database(Path(directory)) as database:
        database.execute("BEGIN")  # one lock for all that follows
        info = flight_info(database, Path(directory))
        of_tags = database.execute(_HEARD).fetchall()
        ends = [info.start_time_ns, *(end_ns for *_, end_ns in of_tags)]
        for table in ("poses", "search_reports"):
            ends += database.execute(f"SELECT max(time_ns) FROM {table}").fetchone()
        notes = database.execute("SELECT time_ns, text FROM notes ORDER BY time_ns").fetchall()
        heard = {
            int(tag_id): HeardTag(
                pulses=int(pulses), first_ns=int(first_ns), last_ns=int(last_ns)
            )
            for tag_id, pulses, first_ns, last_ns, _ in of_tags
            if pulses
        }
        vehicle = vehicle_of(notes)
        return FlightOutline(
            info=info,
            end_time_ns=max(int(one) for one in ends if one is not None),
            heard=heard,
            of_ground=vehicle is not None or any(text == GROUND_NOTE for _, text in notes),
            vehicle=vehicle,
            battery_percent=battery_levels(notes),
        )


def read_pulse_levels(directory: Path) -> dict[tuple[int, int], float]:
    """Read how strong each confirmed pulse was [dB], by tag and start [ns].

    Copies of a flight share them to the last digit; two drones that hear the same pulse at the
    same time, each from its own place, do not. Over the link a start keeps no nanoseconds.

    Raises `FormatError`: as `read_outline`.
    """
    with flight_database(directory) as database:
        found = database.execute(_LEVELS)
        levels = {(int(tag_id), int(ns)): float(level) for tag_id, ns, level in found}
        if any(abs(one) >= LATEST_NS for key in levels for one in key):
            raise ValueError("a tag or a time in it is none")
        return levels


def battery_note(percent: int) -> str:
    """Write what is left in the vehicle's battery."""
    return f"battery {percent} %"


def battery_levels(notes: Iterable[tuple[int, str]]) -> tuple[int, ...]:
    """Read what was left [%], from `battery_note`."""
    found = (_BATTERY.fullmatch(text) for _, text in notes)
    return tuple(int(one[1]) for one in found if one is not None)
