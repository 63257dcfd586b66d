"""The supervisor with its real processes: started, killed, stopped, abandoned."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from until import until

from uavrt.config.settings import MavlinkSettings
from uavrt.core.messages import SystemStatus
from uavrt.drone.supervisor.start.usage import children_of
from uavrt.flight.reading.flight_reader import read_flight

pytestmark = pytest.mark.timeout(150)


def descendants(pid: int) -> set[int]:
    found: set[int] = set()
    waiting = [pid]
    while waiting:
        new = set(children_of(waiting.pop())) - found
        found |= new
        waiting += new
    return found


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


def until_status(
    drone: Any, condition: Callable[[SystemStatus], bool], timeout_s: float
) -> SystemStatus:
    """Read the supervisor's records until a status is as wanted."""
    deadline_s = time.monotonic() + timeout_s
    last = None
    while time.monotonic() < deadline_s:
        for topic, record in drone.status.read(0.2):
            if topic == "system_status":
                assert isinstance(record, SystemStatus)
                last = record
                if condition(record):
                    return record
    raise AssertionError(f"never came; last: {last}")


def process(status: SystemStatus, name: str) -> Any:
    return next(p for p in status.processes if p.process == name)


def samples_of(status: SystemStatus) -> float:
    known = {p.process: p for p in status.processes}
    return known["receiver"].counters.get("samples", 0.0) if "receiver" in known else 0.0


def test_killed_and_stopped_processes_come_back_and_no_recorded_pulse_is_lost(
    drone_bay: Any, thesis_scenario: Any
) -> None:
    tags = msgspec.json.encode(thesis_scenario.tags).decode()
    drone = drone_bay.launch(thesis_scenario, tags)

    def three_recorded() -> SystemStatus:
        return until_status(
            drone,
            lambda s: (
                samples_of(s) > 0
                and process(s, "recorder").counters.get("pulses_recorded", 0) >= 3
            ),
            60.0,
        )

    status = three_recorded()
    before = read_flight(status.flight_directory or "").pulse_poses
    for name in ("connection", "detector-1", "receiver", "recorder"):
        old = process(status, name).pid
        os.kill(old, signal.SIGKILL)
        status = until_status(
            drone,
            lambda s, name=name, old=old: (  # type: ignore[misc]
                process(s, name).pid not in (None, old)
                and process(s, name).ok
                and process(s, name).status not in ("starting", "waiting for samples")
            ),
            20.0,
        )
        assert process(status, name).restarts == 1
        assert len(status.tags) == 1
    status = three_recorded()
    after = read_flight(status.flight_directory or "").pulse_poses
    assert {item.pulse for item in before} <= {item.pulse for item in after}
    assert len(after) > len(before)

    # A stopped process counts as dead.
    old = process(status, "detector-1").pid
    os.kill(old, signal.SIGSTOP)
    status = until_status(
        drone, lambda s: process(s, "detector-1").pid not in (None, old), 25.0
    )
    assert not alive(old)

    # SIGTERM ends everything in good order.
    family = descendants(drone.supervisor.pid)
    drone.supervisor.stop()
    assert drone.supervisor.exit_code == 0
    assert not [pid for pid in family if alive(pid)]
    assert not Path(drone.settings.status_socket).exists()
    flight = read_flight(status.flight_directory or "")
    assert len(flight.pulse_poses) >= len(after)
    assert flight.info.tags[0].tag_id == 2


def test_without_autopilot_and_ground_it_detects_and_records_and_needs_no_helper(
    drone_bay: Any, thesis_scenario: Any
) -> None:
    """Cart, bench and field-monitor use; the death of each helper, and of the supervisor."""
    tags = msgspec.json.encode(thesis_scenario.tags).decode()
    drone = drone_bay.launch(thesis_scenario, tags, mavlink=MavlinkSettings(address=""))
    status = until_status(drone, lambda s: samples_of(s) > 0, 30.0)
    pids = {p.process: p.pid for p in status.processes}
    nursery = int(process(status, "supervisor").counters["nursery_pid"])
    # The helper of the supervisor: nobody ends by its death, and it comes back.
    os.kill(nursery, signal.SIGKILL)
    status = until_status(
        drone,
        lambda s: process(s, "supervisor").counters["nursery_pid"] not in (0.0, nursery),
        30.0,
    )
    assert {p.process: p.pid for p in status.processes} == pids
    # The helper of the receiver is the radio's program: it ends with it.
    (radio,) = children_of(process(status, "receiver").pid)
    os.kill(process(status, "receiver").pid, signal.SIGKILL)
    status = until_status(
        drone,
        lambda s: (
            process(s, "recorder").counters.get("pulses_recorded", 0) >= 1
            and process(s, "receiver").restarts == 1
        ),
        60.0,
    )
    assert not alive(radio)
    # A killed supervisor leaves neither processes nor the radio program behind.
    family = descendants(drone.supervisor.pid)
    assert len(family) >= 5
    os.kill(drone.supervisor.pid, signal.SIGKILL)
    until(lambda: not any(map(alive, family)), 10.0)
    flight = read_flight(status.flight_directory or "")
    assert flight.pulse_poses
    assert all(item.pose is None for item in flight.pulse_poses)
