"""Tags sent over ROS 2 to a real drone side whose gateway is killed meanwhile."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from until import until

from uavrt.config.settings import Ros2Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import SystemStatus, Tag
from uavrt.link.ros2.ros_records import tag_to_ros

pytestmark = [pytest.mark.timeout(150)]


def test_a_gateway_killed_between_tags_or_before_the_start_lets_no_incomplete_list_fly(
    drone_bay: Any, thesis_scenario: Any, ros_domain: int, ros_peer: Any
) -> None:
    drone = drone_bay.launch(
        thesis_scenario, ros2=Ros2Settings(enabled=True, domain_id=ros_domain)
    )
    logs = ros_peer.listen("rosout")
    lines: list[str] = []
    status: list[SystemStatus] = []

    def seen(condition: Callable[[], object]) -> None:
        def look() -> bool:
            status.extend(r for _, r in drone.status.read(0.2) if isinstance(r, SystemStatus))
            lines.extend(line.msg for line in logs.messages())
            return bool(status) and bool(condition())

        until(look, 60.0)

    def advertise() -> None:
        ros_peer.advertise("store_tag_information", "release_tag_information")
        ros_peer.advertise("control_start_subprocess", "control_stop_subprocess")

    def send(tag: Tag) -> None:
        ros_peer.publish("store_tag_information", ros_peer.tag(tag_to_ros(tag)))

    def gateway() -> int | None:
        pid: int | None = next(p.pid for p in status[-1].processes if p.process == "ros2")
        return pid

    def kill_gateway() -> None:
        old = gateway()
        assert old is not None
        os.kill(old, signal.SIGKILL)
        seen(lambda: gateway() not in (None, old))
        nodes_up = ros_peer.listen("status_detector_subprocess")
        seen(nodes_up)
        advertise()

    advertise()
    (first,) = thesis_scenario.tags
    second, third = (
        replace(first, tag_id=number, frequency_hz=first.frequency_hz + 5e3 * number)
        for number in (4, 6)
    )
    release = ros_peer.release()
    send(first)
    seen(lambda: len(status[-1].tags) == 1)
    kill_gateway()  # and so the second tag is lost

    def two_tags() -> bool:
        send(third)
        return len(status[-1].tags) == 2

    seen(two_tags)
    ros_peer.publish("release_tag_information", release)
    seen(lambda: status[-1].state is SystemState.HAS_TAGS)
    for number in range(2):
        lines.clear()
        seen(
            lambda: (
                ros_peer.publish("control_start_subprocess", ros_peer.order("start"))
                or any("only 2 of 3 tags arrived" in line for line in lines)
            )
        )
        if number == 0:
            kill_gateway()
    for tag in (first, second, third):
        send(tag)
    ros_peer.publish("release_tag_information", release)
    impossible = ros_peer.order("start", center_frequency="148705000")
    ros_peer.publish("control_start_subprocess", impossible)
    seen(lambda: any("20 to 1000 MHz" in line for line in lines))
    assert status[-1].state is SystemState.HAS_TAGS
    ros_peer.publish("control_start_subprocess", ros_peer.order("start"))
    seen(lambda: status[-1].state is SystemState.DETECTING)
    assert len(status[-1].tags) == 3
