"""A whole flight commanded and watched over ROS 2, with the network at its worst."""

import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from command_line import launched
from some import some
from tests.flight.test_delivery import CODED_TAG
from until import until

from uavrt.config.settings import Ros2Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import SystemStatus
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.link.ros2.ros_records import tag_to_ros

pytestmark = [pytest.mark.full_rate, pytest.mark.timeout(150)]


SUBSCRIBER = """
import sys
from uavrt.config.settings import Ros2Settings
from uavrt.link.ros2.network.dds import Participant
Participant(Ros2Settings(domain_id=int(sys.argv[1])))
print("listening", flush=True)
sys.stdin.read()
"""
"""Another computer's gateway: its readers are reliable, as those of any ROS 2 node."""


@pytest.fixture
def subscriber(ros_domain: int) -> Iterator[subprocess.Popen[str]]:
    """A reliable subscriber in a process of its own."""
    with launched("-c", SUBSCRIBER, str(ros_domain), stdin=subprocess.PIPE) as process:
        assert some(process.stdout).readline() == "listening\n"
        yield process
        process.kill()


class Watch:
    """What the supervisor tells and what ROS 2 hears, read together."""

    def __init__(self, drone: Any, pulses: Callable[[], list[bytes]]) -> None:
        self._drone = drone
        self._pulses = pulses
        self.heard: list[bytes] = []
        self.status: SystemStatus | None = None

    def look(self) -> None:
        for _, record in self._drone.status.read(0.2):
            if isinstance(record, SystemStatus):
                self.status = record
        self.heard += self._pulses()

    def process(self, name: str) -> Any:
        return next(p for p in some(self.status).processes if p.process == name)

    def state(self) -> SystemState | None:
        return None if self.status is None else self.status.state


def test_a_flight_is_flown_over_ros_2_whatever_happens_on_its_network(
    drone_bay: Any,
    full_rate_scenario: Any,
    ros_domain: int,
    ros_peer: Any,
    subscriber: subprocess.Popen[str],
) -> None:
    scenario = replace(full_rate_scenario, tag=(*full_rate_scenario.tag, CODED_TAG))
    drone = drone_bay.launch(scenario, ros2=Ros2Settings(enabled=True, domain_id=ros_domain))
    watch = Watch(drone, ros_peer.listen("pulse_pose"))
    bursts = ros_peer.listen("burst")

    def seen(condition: Callable[[], object]) -> None:
        def look() -> bool:
            watch.look()
            return watch.status is not None and bool(condition())

        until(look, 60.0)

    # Tags and start come from ROS 2 alone.
    ros_peer.advertise(
        *("store_tag_information", "store_coded_tag_information", "release_tag_information"),
        *("control_start_subprocess", "control_stop_subprocess"),
        subscribers=2,  # the drone and the other subscriber
    )
    for tag in scenario.tags:
        message = ros_peer.tag(tag_to_ros(tag))
        if tag.coded:
            gaps = np.array([1e3 * gap_s for gap_s in tag.gaps_s])
            message = ros_peer.new("uavrt_interfaces/msg/CodedTag", message, gaps)
            ros_peer.publish("store_coded_tag_information", message)
        else:
            ros_peer.publish("store_tag_information", message)
    seen(lambda: watch.state() is SystemState.RECEIVING_TAGS)
    ros_peer.publish("release_tag_information", ros_peer.release())
    seen(lambda: watch.state() is SystemState.HAS_TAGS)
    ros_peer.publish("control_start_subprocess", ros_peer.order("start"))
    seen(lambda: len(watch.heard) >= 3)

    # A coded tag's burst is a pulse, and besides what is inside.
    inside: list[Any] = []
    seen(lambda: inside.extend(bursts.messages()) or inside)  # type: ignore[func-returns-value]
    burst = inside[0]
    at_s = [one.sec + 1e-9 * one.nanosec for one in burst.starts]
    assert np.diff(at_s) == pytest.approx(CODED_TAG.gaps_s, abs=1e-3)
    assert burst.pulse.tag_id == CODED_TAG.tag_id

    # A subscriber stops, a publisher goes wild, the gateway is killed.
    subscriber.send_signal(signal.SIGSTOP)
    for _ in range(3000):
        ros_peer.publish("store_tag_information", ros_peer.tag())
        ros_peer.publish("control_start_subprocess", ros_peer.order("start"))
    heard = len(watch.heard)
    seen(lambda: len(watch.heard) >= heard + 3)
    old = watch.process("ros2").pid
    os.kill(old, signal.SIGKILL)
    seen(lambda: watch.process("ros2").pid not in (None, old))
    heard = len(watch.heard)
    seen(lambda: len(watch.heard) >= heard + 3)
    assert watch.state() is SystemState.DETECTING
    restarts = {p.process: p.restarts for p in watch.status.processes}  # type: ignore[union-attr]
    assert restarts.pop("ros2") == 1
    assert set(restarts.values()) == {0}
    assert watch.process("receiver").counters["samples_lost"] == 0
    directory = watch.status.flight_directory  # type: ignore[union-attr]

    ros_peer.publish("control_stop_subprocess", ros_peer.order("stop"))
    seen(lambda: watch.state() is SystemState.HAS_TAGS)
    recorded = read_flight(directory or "")
    starts_ns = {item.pulse.start_time_ns for item in recorded.pulse_poses}
    told = [ros_peer.read(cdr, "pulse_pose") for cdr in watch.heard]
    for message in told:
        time = message.pulse.start_time
        assert time.sec * 10**9 + time.nanosec in starts_ns
        assert message.antenna_pose.position.x == pytest.approx(
            full_rate_scenario.home.latitude_deg, abs=0.01
        )
