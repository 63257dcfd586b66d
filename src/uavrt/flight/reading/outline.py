"""Read summaries of flights for long lists, without creating an object for each pulse."""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uavrt.core.messages import FlightInfo
from uavrt.flight.reading.flight_reader import LATEST_NS, flight_database, flight_info
from uavrt.flight.reading.noted_places import GROUND_NOTE, vehicle_of

_BATTERY = re.compile(r"battery (\d{1,3}) %")
_COUNTED = "detection_status = 'confirmed' AND ghost_of_tag_id IS NULL"
_HEARD = (
    f"SELECT tag_id, count(*) FILTER (WHERE {_COUNTED}),"
    f" min(start_time_ns) FILTER (WHERE {_COUNTED}),"
    f" max(start_time_ns) FILTER (WHERE {_COUNTED}), max(end_time_ns), count(*)"
    " FROM pulses GROUP BY tag_id"
)
"""SQL query that returns for each tag the number and times of confirmed pulses, and for all
tags the end of the last pulse and the number of pulses."""
_LEVELS = (
    "SELECT tag_id, start_time_ns, snr_db FROM pulses WHERE detection_status = 'confirmed'"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedTag:
    """Confirmed pulses of one tag in a flight: number and times, without receiver artefacts."""

    pulses: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOutline:
    """Summary of a flight: duration, received tags and battery."""

    info: FlightInfo
    end_time_ns: int
    """Time of the flight's last record [ns]."""
    heard: dict[int, ReceivedTag]
    all_pulses: int
    """Number of pulses of any status, including spurious pulses that the receiver produced."""
    of_ground: bool
    """True if a ground station recorded the flight, False if the drone did."""
    vehicle: str | None
    """Number and name of the vehicle; None unless a ground station recorded them."""
    battery_percent: tuple[int, ...]
    """Battery levels recorded by a ground station, in the order of time [%]."""

    @property
    def pulses(self) -> int:
        """Total number of confirmed pulses of all tags."""
        return sum(one.pulses for one in self.heard.values())

    @property
    def directory(self) -> Path:
        """Directory of the flight, as a path."""
        return Path(self.info.directory)


def read_outline(directory: str | os.PathLike[str]) -> FlightOutline:
    """Read a flight's summary; raises `FormatError` for a missing or damaged flight."""
    with flight_database(Path(directory)) as database:
        database.execute("BEGIN")  # one lock for all that follows
        info = flight_info(database, Path(directory))
        of_tags = database.execute(_HEARD).fetchall()
        ends = [info.start_time_ns, *(end_ns for *_, end_ns, _ in of_tags)]
        for table in ("poses", "search_reports"):
            ends += database.execute(f"SELECT max(time_ns) FROM {table}").fetchone()
        end_time_ns = max(int(one) for one in ends if one is not None)
        if end_time_ns >= LATEST_NS:
            raise ValueError("the flight has an invalid time")
        notes = database.execute("SELECT time_ns, text FROM notes ORDER BY time_ns").fetchall()
        heard = {
            int(tag_id): ReceivedTag(
                pulses=int(pulses), first_ns=int(first_ns), last_ns=int(last_ns)
            )
            for tag_id, pulses, first_ns, last_ns, _, _ in of_tags
            if pulses
        }
        vehicle = vehicle_of(notes)
        return FlightOutline(
            info=info,
            end_time_ns=end_time_ns,
            heard=heard,
            all_pulses=sum(count for *_, count in of_tags),
            of_ground=vehicle is not None or any(text == GROUND_NOTE for _, text in notes),
            vehicle=vehicle,
            battery_percent=battery_levels(notes),
        )


def read_pulse_levels(directory: Path) -> dict[tuple[int, int], float]:
    """Level of each confirmed pulse [dB], by tag and start time [ns]; used to recognise copies.

    In copies of a flight the levels agree to the last digit, but two drones that receive the
    same pulse record different levels. A start time that was sent over the link is rounded.
    """
    with flight_database(directory) as database:
        found = database.execute(_LEVELS)
        levels = {(int(tag_id), int(ns)): float(level) for tag_id, ns, level in found}
        if any(abs(one) >= LATEST_NS for key in levels for one in key):
            raise ValueError("a pulse has an invalid tag or time")
        return levels


def battery_note(percent: int) -> str:
    """Format a note with the vehicle's battery level [%]."""
    return f"battery {percent} %"


def battery_levels(notes: Iterable[tuple[int, str]]) -> tuple[int, ...]:
    """Read battery levels [%] from a flight's notes."""
    found = (_BATTERY.fullmatch(text) for _, text in notes)
    return tuple(int(one[1]) for one in found if one is not None)
