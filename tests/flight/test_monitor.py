"""A running drone side seen, started and stopped from its own terminal: cart and bench use."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from command_line import started
from rich.console import Console
from tests.flight.conftest import Drone, process
from until import until

from uavrt.cli.system.monitor_view import MonitorView
from uavrt.cli.system.start_stop import start_detection, stop_detection
from uavrt.config.settings import MavlinkSettings, RecordingSettings
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.commands import SystemState
from uavrt.core.errors import CommandRefused
from uavrt.drone.supervisor.start.usage import children_of, descendants_of
from uavrt.flight.reading.flight_reader import read_flight
from uavrt_experiments.resources.usage import is_alive

pytestmark = pytest.mark.timeout(150)


def show_until(drone: Any, view: MonitorView, condition: Any, timeout_s: float = 40.0) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, view.status
        for topic, record in drone.status.read(0.2):
            view.add(topic, record, time.monotonic())


def drawn(view: MonitorView) -> str:
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(view.render(time.monotonic()))
    console.file.close()
    return console.export_text()


def test_a_cart_without_autopilot_is_started_watched_and_stopped_and_needs_no_helper(
    drone_bay: Any, thesis_scenario: Any, tmp_path: Path
) -> None:
    """The command line finds the running system by its flights."""
    flights = tmp_path / "f"
    drone = drone_bay.launch(
        thesis_scenario,
        mavlink=MavlinkSettings(address=""),
        recording=RecordingSettings(directory=str(flights)),
        status_socket=str(flights / "status.sock"),
    )
    tags = tmp_path / "tags.toml"
    write_tags(tags, thesis_scenario.tags)

    def uavrt(*arguments: str) -> str:
        return started("monitor", "--flight-dir", flights, *arguments).stdout

    view = MonitorView()
    assert "waiting for the supervisor" in drawn(view)
    assert '"idle"' in uavrt("--json")
    with pytest.raises(CommandRefused, match="no tag"):
        start_detection(drone.status, ())
    first = uavrt("--start", str(tags)).replace("\n", "")
    assert "detecting; flight:" in first
    assert "detecting" in uavrt("--once")
    assert "stopping; flight:" in uavrt("--stop")
    nothing = started("monitor", "--flight-dir", tmp_path)
    assert nothing.returncode == 2
    assert "no running system answers" in nothing.stderr

    show_until(drone, view, lambda: view.status and view.status.state is SystemState.HAS_TAGS)
    flight = start_detection(drone.status, thesis_scenario.tags)
    assert Path(flight).name not in first
    # The pulses may still be those of the flight before.
    show_until(drone, view, lambda: view.status and view.status.state is SystemState.DETECTING)
    show_until(drone, view, lambda: view.heard and view.heard[2].pulses >= 4)
    text = drawn(view)
    for word in ("detecting", "receiver", "recorder", "MHz", "dB", Path(flight).name):
        assert word in text.replace("\n", "")
    assert view.losses == 0
    assert_lives_without_helpers(drone)
    assert stop_detection(drone.status) == flight
    show_until(drone, view, lambda: view.status and view.status.state is SystemState.HAS_TAGS)
    recorded = read_flight(flight).pulse_poses
    assert len(recorded) >= 4
    assert all(item.pose is None for item in recorded)
    # A supervisor that is killed in flight leaves nothing running, nor the radio program.
    start_detection(drone.status, thesis_scenario.tags)
    receiver = drone.pid_of("receiver")
    until(lambda: children_of(receiver))
    family = descendants_of(drone.supervisor.pid)
    assert len(family) >= 5
    os.kill(drone.supervisor.pid, signal.SIGKILL)
    until(lambda: not any(map(is_alive, family)), 10.0)


def assert_lives_without_helpers(drone: Drone) -> None:
    """Kill the supervisor's nursery, and the receiver, whose helper is the radio's program."""
    status = drone.status_now("receiver")
    pids = {one.process: one.pid for one in status.processes}
    nursery = int(process(status, "supervisor").counters["nursery_pid"])
    os.kill(nursery, signal.SIGKILL)
    status = drone.status_when(
        lambda s: process(s, "supervisor").counters["nursery_pid"] not in (0.0, nursery)
    )
    assert {one.process: one.pid for one in status.processes} == pids
    receiver, recorder = process(status, "receiver"), process(status, "recorder")
    (radio,) = children_of(receiver.pid)
    os.kill(receiver.pid, signal.SIGKILL)
    drone.status_when(
        lambda s: (
            process(s, "receiver").restarts == 1
            and process(s, "recorder").counters["pulses_recorded"]
            > recorder.counters["pulses_recorded"]
        )
    )
    assert not is_alive(radio)
