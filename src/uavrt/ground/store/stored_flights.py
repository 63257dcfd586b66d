"""List the flights on this computer, and read their data in columns: 10 MB for 100 000 pulses,
in place of 150 MB of objects.
"""

import math
import os
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import FormatError, NotFound, RecordingError, UsageError, os_errors_as
from uavrt.core.messages import DetectionStatus, Pulse, PulsePose, Tag
from uavrt.flight.database.fields import Row
from uavrt.flight.database.plain_database import open_plain
from uavrt.flight.database.schema import POSES, PULSE_POSE_COLUMNS, PULSES, pose_row, read_older
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flown_name, order_noted
from uavrt.flight.reading.flight_cache import FlightCache
from uavrt.flight.reading.flight_reader import DAMAGED, ground_states_in
from uavrt.flight.reading.noted_places import Places, places_of
from uavrt.flight.reading.outline import read_outline
from uavrt.flight.reading.quiet_noise import read_quiet_noise_db, usual_noise_db
from uavrt.ground.store.known_flights import (
    FlightChoice,
    FlightSummary,
    keep_flights,
    kept_flights,
)
from uavrt.localization.estimates.heard import Heard, PoseColumns, PulseColumns

CHUNK = 4000
STATUSES: tuple[DetectionStatus, ...] = tuple(
    status for status in get_args(DetectionStatus) if status != "integrated"
)
"""Detection statuses of a pulse in flight; the page uses their indices."""

PLACE_COLUMNS = (
    "latitude_deg",
    "longitude_deg",
    "altitude_relative_m",
    "quaternion_w",
    "quaternion_x",
    "quaternion_y",
    "quaternion_z",
)
"""Columns of a pose, after its time, that `FlightLibrary.columns` reads."""
PULSE_COLUMNS = (
    "tag_id",
    "start_time_ns",
    "frequency_hz",
    "snr_db",
    "group_snr_db",
    "noise_psd",
    "detection_status",
    "rate",
    *PLACE_COLUMNS,
    "also_possible_tag_id",
    "ghost_of_tag_id",
    "clipped",
)
"""Columns that `FlightLibrary.pulses` reads, of a pulse and its pose, by field name."""

_CELLS: dict[str, tuple[str, Callable[[Pulse], float]]] = {
    "detection_status": (
        "CASE p.detection_status WHEN 'confirmed' THEN 2 WHEN 'detected' THEN 1 ELSE 0 END",
        lambda pulse: STATUSES.index(pulse.detection_status),
    ),
    "also_possible_tag_id": (
        # As a number a text between spaces is its first.
        "CAST(p.also_possible_tag_ids AS INTEGER)",
        lambda pulse: next(iter(pulse.also_possible_tag_ids), math.nan),
    ),
    "clipped": ("coalesce(p.clipped, 0)", lambda pulse: pulse.clipped),
}
"""Conversions of non-numeric fields to numbers, each as an SQL expression and as a Python
function."""
_SELECT_PULSES = (
    "SELECT "
    + ", ".join(
        _CELLS[name][0] if name in _CELLS else f"{'q' if name in POSES.types else 'p'}.{name}"
        for name in PULSE_COLUMNS
    )
    + " FROM pulses p LEFT JOIN pulse_poses q USING (pulse_id) ORDER BY p.pulse_id"
)
_SELECT_RECORDS = (
    f"SELECT {PULSE_POSE_COLUMNS} FROM pulses LEFT JOIN pulse_poses USING (pulse_id) "
    "ORDER BY pulse_id"
)
_SELECT_POSES = (
    f"SELECT time_ns, {', '.join(PLACE_COLUMNS)} FROM poses "
    "WHERE latitude_deg IS NOT NULL ORDER BY time_ns"
)
_SELECT_TAKEOFF = (
    "SELECT altitude_amsl_m - altitude_relative_m FROM poses "
    "WHERE latitude_deg IS NOT NULL ORDER BY time_ns LIMIT 1"
)
_FIRST_OF_QUATERNION = PULSE_COLUMNS.index("quaternion_w")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Pulses and poses of one flight, in columns."""

    pulses: NDArray[np.float64]
    """Array (len(PULSE_COLUMNS), n); times as float64 nanoseconds, exact to 256 ns."""
    poses: NDArray[np.float64]
    """Array (8, m): time_ns, latitude, longitude, relative altitude, quaternion w x y z."""
    on_ground_ns: tuple[tuple[int, int], ...] = ()
    """Start and end of each time on the ground, as the autopilot reported [ns]."""
    takeoff_amsl_m: float = math.nan
    """Height above sea level at which relative altitudes are zero, from the first pose [m]."""
    goes_on: bool = False
    """True while the flight is in progress and more data may arrive."""

    def heard(self, tags: Sequence[Tag], name: str = "this vehicle") -> Heard:
        """Convert pulses and poses to the input of the position estimator."""
        pulses, poses, rate = self.pulses, self.poses, np.nan_to_num(self["rate"], nan=1.0)
        return Heard.of(
            self["tag_id"].astype(np.int64),
            PulseColumns(
                time_ns=self["start_time_ns"].astype(np.int64),
                latitude_deg=self["latitude_deg"],
                longitude_deg=self["longitude_deg"],
                height_m=self["altitude_relative_m"],
                quaternion_wxyz=pulses[_FIRST_OF_QUATERNION : _FIRST_OF_QUATERNION + 4].T,
                snr_db=self["snr_db"],
                noise_psd=self["noise_psd"],
                frequency_hz=self["frequency_hz"],
                rate=rate.astype(np.int64),
                altitude_amsl_m=self["altitude_relative_m"] + self.takeoff_amsl_m,
            ),
            PoseColumns(
                time_ns=poses[0].astype(np.int64),
                latitude_deg=poses[1],
                longitude_deg=poses[2],
                height_m=poses[3],
                quaternion_wxyz=poses[4:8].T,
                altitude_amsl_m=poses[3] + self.takeoff_amsl_m,
                on_ground_ns=self.on_ground_ns,
            ),
            tags=tags,
            name=name,
            goes_on=self.goes_on,
        )

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the column of the pulses with this name."""
        column: NDArray[np.float64] = self.pulses[PULSE_COLUMNS.index(name)]
        return column


class FlightLibrary:
    """The flights in one directory, recorded here or copied from a drone."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._list = directory / "flight_list.json"
        self._known = FlightCache(self._read_summary, kept_flights(self._list))
        self._kept = dict(self._known.kept)
        self._quiet = FlightCache(lambda path: read_quiet_noise_db(Path(path)))

    def summaries(self) -> list[FlightSummary]:
        """List all readable flights, newest first; a drone's in the order it recorded."""
        found = []
        with suppress(FileNotFoundError), os.scandir(self.directory) as entries:
            for entry in entries:
                with suppress(FormatError, UsageError, OSError):
                    found.append(self._summary(entry.name))
        noted = order_noted(self.directory)

        def age(flight: FlightSummary) -> tuple[int, int]:
            return noted.get(flown_name(flight.flight_id), -1), flight.start_time_ns

        self._keep({flight.flight_id for flight in found})
        return sorted(found, key=age, reverse=True)

    def find(
        self, choice: FlightChoice, after: int, limit: int
    ) -> tuple[int, list[FlightSummary]]:
        """Number of matching flights, and `limit` of them from index `after`, newest first."""
        found = [flight for flight in self.summaries() if choice.holds(flight)]
        return len(found), found[after : after + limit]

    def has(self, flight_id: str) -> bool:
        """True if the flight exists."""
        try:
            self.path(flight_id)
        except UsageError:
            return False
        return True

    def path(self, flight_id: str) -> Path:
        """Directory of a flight; raises `UsageError` if there is no such flight."""
        path = self.directory / flight_id
        plain = flight_id and flight_id not in (".", "..") and path.name == flight_id
        # Not by Path.is_file, which raises for names that no file can have.
        if not plain or not os.path.isfile(FlightLayout(path).database):
            raise NotFound(f"there is no flight {flight_id[:80]!r}")
        return path

    def summary(self, flight_id: str) -> FlightSummary:
        """Summary of a flight; raises `UsageError` or `FormatError`."""
        self.path(flight_id)
        return self._summary(flight_id)

    def _summary(self, flight_id: str) -> FlightSummary:
        place = f"{self.directory}/{flight_id}"
        flight = self._known.get(place)
        starred = os.path.exists(f"{place}/starred")  # as it is now
        return flight if flight.starred == starred else replace(flight, starred=starred)

    def _keep(self, flight_ids: set[str]) -> None:
        """Write the cache of summaries for these flights, if it has changed."""
        known = self._known.kept
        for place in known.keys() - {f"{self.directory}/{one}" for one in flight_ids}:
            known.pop(place, None)
        if known != self._kept:
            self._kept = dict(known)
            with suppress(OSError):
                keep_flights(self._list, self._kept.values())

    def _read_summary(self, place: str) -> FlightSummary:
        outline = read_outline(place)
        return FlightSummary(
            flight_id=os.path.basename(place),
            start_time_ns=outline.info.start_time_ns,
            end_time_ns=outline.end_time_ns,
            pulses=outline.all_pulses,
            tags=outline.info.tags,
            source="ground" if outline.of_ground else "drone",
            vehicle=outline.vehicle,
        )

    def usual_noise_db(self, system_id: int | None, *, but: str | None) -> float | None:
        """Usual receiver noise at rest [dB] in a vehicle's past flights; None if unknown.

        `system_id`: the vehicle (flights of unknown vehicles count too); None: any vehicle.
        `but`: flight to skip.
        """
        flights = (
            flight
            for flight in self.summaries()
            if flight.flight_id != but and _is_of(flight, system_id)
        )
        return usual_noise_db(self._quiet_noise_db(one.flight_id) for one in flights)

    def _quiet_noise_db(self, flight_id: str) -> float | None:
        try:
            return self._quiet.get(f"{self.directory}/{flight_id}")
        except FormatError:  # damaged, or only busy: read again next time
            return None

    def places(self, flight_id: str) -> Places:
        """Take-off position and operator's marks of a flight; `UsageError` or `FormatError`."""
        with self._database(flight_id) as database:
            return places_of(
                database.execute("SELECT time_ns, text FROM notes ORDER BY time_ns").fetchall()
            )

    def star(self, flight_id: str, starred: bool) -> None:
        """Protect a flight and its copies from automatic removal, or end the protection."""
        self.path(flight_id)
        flown = flown_name(flight_id)
        for flight in self.directory.iterdir():
            if flown_name(flight.name) == flown and FlightLayout(flight).database.is_file():
                _mark(FlightLayout(flight).star, starred)

    def columns(self, flight_id: str) -> Columns:
        """Read the pulses and poses of a flight; raises `UsageError` or `FormatError`."""
        with self._database(flight_id) as database:
            spans = ground_states_in(database).spans()
            first = database.execute(_SELECT_TAKEOFF).fetchone()
        return Columns(
            pulses=self.pulses(flight_id),
            poses=self.poses(flight_id),
            on_ground_ns=spans,
            takeoff_amsl_m=math.nan if first is None or first[0] is None else float(first[0]),
        )

    def pulses(self, flight_id: str) -> NDArray[np.float64]:
        """Read the pulses of a flight: array (len(PULSE_COLUMNS), n)."""
        with self._database(flight_id) as database:
            return _columns(database, "pulses", _SELECT_PULSES, len(PULSE_COLUMNS))

    def poses(self, flight_id: str) -> NDArray[np.float64]:
        """Read the poses of a flight: array (8, m), as `Columns.poses`."""
        with self._database(flight_id) as database:
            return _columns(database, "poses", _SELECT_POSES, 8)

    def records(self, flight_id: str, after: int, limit: int) -> list[dict[str, Any]]:
        """Read at most `limit` pulses as stored records, skipping the first `after`."""
        with self._database(flight_id) as database:
            rows = database.execute(f"{_SELECT_RECORDS} LIMIT ? OFFSET ?", (limit, after))
            return [_record(row) for row in rows]

    def log(self, flight_id: str) -> list[dict[str, Any]]:
        """Status texts and notes of a flight in order of time."""
        with self._database(flight_id) as database:
            rows = database.execute(
                "SELECT time_ns, severity, text FROM status_texts UNION ALL "
                "SELECT time_ns, 6, text FROM notes ORDER BY time_ns"
            ).fetchall()
        return [
            {"time_ns": time_ns, "severity": severity, "text": text, "source": "flight"}
            for time_ns, severity, text in rows
        ]

    @contextmanager
    def _database(self, flight_id: str) -> Iterator[sqlite3.Connection]:
        path = FlightLayout(self.path(flight_id)).database
        try:
            with closing(open_plain(path)) as database:
                read_older(database)
                yield database
        except DAMAGED as error:
            raise FormatError(f"{path} cannot be read: {error}") from error


def _record(row: Row) -> dict[str, Any]:
    """Record of a pulse and its pose for the page, from a row of `PULSE_POSE_COLUMNS`."""
    width = len(PULSES.types)
    pulse = PULSES.values(row[:width])
    values = pulse | dict(zip(POSES.types, row[width:], strict=True))
    record = {name: values[name] for name in PULSE_COLUMNS if name in values}
    lists = ["also_possible_tag_ids"]
    if pulse["burst_starts_ns"]:
        lists += ["burst_starts_ns", "burst_snrs_db"]
    confirmed = pulse["detection_status"] == "confirmed"
    return record | {name: list(pulse[name]) for name in lists} | {"confirmed": confirmed}


def pulse_cells(item: PulsePose) -> tuple[float, ...]:
    """A pulse as numbers, in the order of `PULSE_COLUMNS`."""
    pose = dict(zip(POSES.types, pose_row(item.pose), strict=True))
    cells = []
    for name in PULSE_COLUMNS:
        if name in _CELLS:
            cell = _CELLS[name][1](item.pulse)
        else:
            cell = pose[name] if name in pose else getattr(item.pulse, name)
        cells.append(math.nan if cell is None else cell)
    return tuple(cells)


def _columns(
    database: sqlite3.Connection, table: str, select: str, width: int
) -> NDArray[np.float64]:
    (count,) = database.execute(f"SELECT count(*) FROM {table}").fetchone()
    cells = np.empty((width, count))
    cursor, place = database.execute(select), 0
    while place < count and (rows := cursor.fetchmany(min(CHUNK, count - place))):
        # NULL becomes NaN on the way to float64.
        cells[:, place : place + len(rows)] = np.array(rows, np.float64).T
        place += len(rows)
    return cells[:, :place]


def _mark(star: Path, starred: bool) -> None:
    with os_errors_as(
        RecordingError,
        f"cannot change {star}",
        "Check that this user may write in the flight's directory",
    ):
        if starred:
            star.touch()
        else:
            star.unlink(missing_ok=True)


def _is_of(flight: FlightSummary, system_id: int | None) -> bool:
    """True if a flight may be from this vehicle: numbers are equal, or one is unknown."""
    number = None if flight.vehicle is None else flight.vehicle.partition(",")[0]
    return None in (number, system_id) or number == str(system_id)


def known(value: float) -> float | None:
    """Return a finite number unchanged, and None for other values, since JSON has no NaN."""
    return float(value) if math.isfinite(value) else None
