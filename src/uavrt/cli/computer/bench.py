"""``uavrt doctor --flight``: check the drone's own computer before a first flight."""

from pathlib import Path

from uavrt.config.settings import Settings
from uavrt.core.clock import monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.errors import UavrtError
from uavrt.core.messages import SystemStatus, VehicleReport
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.drone.computer.bench import Bench, FlightFacts, first_flight
from uavrt.drone.computer.computer_checks import (
    check_card,
    check_disk,
    check_kept_time,
    check_radio,
)
from uavrt.drone.computer.finding import Finding
from uavrt.drone.status_reader import StatusReader, status_socket_path
from uavrt.flight.flight_order import flights_in_order
from uavrt.flight.reading.quiet_noise import read_usual_noise_db

LISTEN_NS = ns_from_s(30.0)
"""Time for which the running system is observed [ns]; it contains several intervals of any tag
and thirty noise reports."""
ENOUGH_NS = ns_from_s(5.0)
"""Time after which the observation may end early if all checks pass [ns]."""
AUTOPILOT_RECEIVED = ("ready", "waiting for ground station")
"""States of the connection process in which the autopilot and its time have been received."""


def bench_findings(settings: Settings) -> list[Finding]:
    """Observe the running system, check its reports and return the findings."""
    try:
        reader = StatusReader(status_socket_path(settings))
    except (UavrtError, OSError):
        remedy = "Start it: sudo systemctl start uavrt, or uavrt run"
        return [Finding(what="drone", ok=False, text="uavrt does not run here", remedy=remedy)]
    watch, begun_ns = _SystemWatch(settings), _now_ns()
    try:
        while reader.is_open and (passed_ns := _now_ns() - begun_ns) < LISTEN_NS:
            for _, record in reader.read(0.5):
                watch.add(record, _now_ns())
            if passed_ns > ENOUGH_NS and watch.is_complete():
                break
    finally:
        reader.close()
    return watch.findings()


class _SystemWatch:
    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._bench = Bench()
        self._status: SystemStatus | None = None
        self._battery_percent: float | None = None
        self._usual_noise_db: float | None = None
        self._compared = False
        self._here = (check_disk(settings), check_card(settings), check_kept_time())

    def add(self, record: object, now_ns: int) -> None:
        self._bench.add(record, now_ns)
        match record:
            case SystemStatus():
                self._status = record
            case VehicleReport(seen=seen):
                self._battery_percent = None if seen is None else seen.battery_percent

    def is_complete(self) -> bool:
        """True if all checks pass and at least one tag is searched for."""
        detects = self._status is not None and self._status.state is SystemState.DETECTING
        return detects and all(one.ok or one.open for one in self.findings())

    def findings(self) -> list[Finding]:
        """Check the reports received so far; the battery only if its charge is reported."""
        status, pose_ns, now_ns = self._status, self._bench.pose_ns, _now_ns()
        processes = {} if status is None else {one.process: one for one in status.processes}
        link = processes.get("connection")
        facts = FlightFacts(
            tags=() if status is None else status.tags,
            state=None if status is None else status.state,
            heard=status is not None,
            time_known=link is not None and link.status in AUTOPILOT_RECEIVED,
            pose_age_s=None if pose_ns is None else (now_ns - pose_ns) / NANOSECONDS_PER_SECOND,
            battery_percent=self._battery_percent,
            usual_noise_db=self._usual_noise(status),
            own_findings=(check_radio(self._settings, status), *self._here),
        )
        found = first_flight(facts, self._bench, now_ns)
        has_charge = self._battery_percent is not None
        return [one for one in found if has_charge or one.what != "battery"]

    def _usual_noise(self, status: SystemStatus | None) -> float | None:
        """Usual noise of past flights, without the present one [dB]; None while unknown."""
        if status is not None and not self._compared:
            now = Path(status.flight_directory).name if status.flight_directory else None
            flights = flights_in_order(Path(self._settings.recording.directory))
            past = (one for one in reversed(flights) if one.name != now)
            self._usual_noise_db, self._compared = read_usual_noise_db(past), True
        return self._usual_noise_db


def _now_ns() -> int:
    return ns_from_s(monotonic_s())
