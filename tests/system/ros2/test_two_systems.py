"""Two drones in one ROS domain, and recordings played into it: real gateway processes."""

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import made
import pytest
from some import some
from until import until

from uavrt.cli.signals.pulse_listeners import RosPulses
from uavrt.config.settings import Ros2Settings
from uavrt.core.errors import UsageError
from uavrt.core.messages import Command
from uavrt.link.ros2.ros_records import tag_to_ros

TAG = made.tag()
PULSE = made.pulse(1_777_623_301_019_828_320, frequency_hz=148_710_000.0)


def test_what_one_drone_s_ground_station_asks_does_not_command_the_other(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    settings = Ros2Settings(enabled=True, domain_id=ros_domain, accept_pulses=True)
    mine, other = launch(settings), launch(settings)
    number = iter(range(1, 10_000))

    def heard() -> bool:
        for name in ("start_tags", "add_tag", "end_tags", "start_detection", "stop_detection"):
            asked: Any = name
            command = Command(name=asked, request_id=next(number), source="mavlink 255/190")
            mine.send("command", replace(command, tag=TAG if name == "add_tag" else None))
        mine.send("pulse", PULSE)
        return bool(other.counters()["ros2_messages_of_gateways"] >= 20)

    until(heard)
    told = other.counters()
    assert told["ros2_commands"] == told["ros2_pulses_taken"] == 0
    # An operator is obeyed all the same, by both.
    ros_peer.advertise("control_stop_subprocess", subscribers=2)
    ros_peer.publish("control_stop_subprocess", ros_peer.order("stop"))
    for gateway in (mine, other):
        assert gateway.receive("command")[0].name == "stop_detection"


def test_a_recording_with_the_live_names_does_not_command(launch: Any, ros_peer: Any) -> None:
    gateway = launch()
    # `ros2 bag play` publishes everything as one participant.
    ros_peer.advertise("pulse_pose", "control_stop_subprocess")
    ros_peer.publish("control_stop_subprocess", ros_peer.order("stop"))
    until(lambda: gateway.counters()["ros2_messages_of_gateways"] == 1)
    assert gateway.counters()["ros2_commands"] == 0


def test_a_hundred_tags_their_release_and_the_start_at_once_are_taken_in_their_order(
    launch: Any, ros_peer: Any
) -> None:
    gateway = launch()
    ros_peer.advertise("store_tag_information", "release_tag_information")
    ros_peer.advertise("control_start_subprocess")
    tags = [replace(TAG, tag_id=2 * n, frequency_hz=148e6 + 5e3 * n) for n in range(1, 101)]
    messages = [ros_peer.tag(tag_to_ros(tag)) for tag in tags]
    ros_peer.publish_first("release_tag_information", ros_peer.release(now=False))
    ros_peer.publish_first("control_start_subprocess", ros_peer.order("nothing"))
    ros_peer.publish_first("store_tag_information", messages[0])
    for message in messages[1:]:
        ros_peer.publish("store_tag_information", message)
    ros_peer.publish("release_tag_information", ros_peer.release())
    ros_peer.publish("control_start_subprocess", ros_peer.order("start"))
    commands = gateway.receive("command", 103)
    names = [command.name for command in commands]
    assert names == ["start_tags", *["add_tag"] * 100, "end_tags", "start_detection"]
    assert [command.tag for command in commands[1:-2]] == tags
    assert commands[-1].tag_count == 100


REMOTE = """
import sys
from uavrt.cli.signals.pulse_listeners import RosPulses
pulses = RosPulses("lo", (), "drone1")
sys.stdin.read()
pulses.close()
"""


def test_a_remote_detector_has_a_node_name_of_its_own_and_the_drone_s_namespace(
    ros_domain: int, ros_peer: Any
) -> None:
    infos = ros_peer.listen("ros_discovery_info")
    environment = os.environ | {"ROS_DOMAIN_ID": str(ros_domain)}
    with subprocess.Popen(
        [sys.executable, "-c", REMOTE], stdin=subprocess.PIPE, env=environment
    ) as process:
        info = infos.newest(lambda info: len(info.node_entities_info_seq) == 1)
        (node,) = info.node_entities_info_seq
        assert node.node_name.startswith("Detector_")
        assert node.node_name.endswith(f"_{process.pid}")
        assert node.node_namespace == "/drone1"
        until(lambda: "rt/drone1/pulse" in ros_peer.endpoints())
        some(process.stdin).close()
        assert process.wait(60.0) == 0


def test_a_namespace_that_is_none_is_refused() -> None:
    with pytest.raises(UsageError, match="not a ROS namespace"):
        RosPulses("lo", (TAG,), "drone 1")


HOSTILE = """
import ctypes, sys
from cyclonedds.domain import Domain
from cyclonedds.internal import load_cyclonedds
from uavrt.link.ros2.network.dds import cyclone_config
number = int(sys.argv[1])
domain = Domain(number, cyclone_config(()))
library = load_cyclonedds()
library.dds_create_qos.restype = ctypes.c_void_p
qos = ctypes.c_void_p(library.dds_create_qos())
library.dds_qset_entity_name(qos, ctypes.c_char_p(bytes([255, 254])))
for _ in range(3):
    assert library.dds_create_participant(ctypes.c_uint32(number), qos, None) > 0
print("here", flush=True)
sys.stdin.read()
"""
"""Participants whose names are not UTF-8."""


def test_a_name_that_is_none_makes_the_gateway_deaf_to_nobody(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    gateway = launch()
    with subprocess.Popen(
        [sys.executable, "-c", HOSTILE, str(ros_domain)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as hostile:
        assert some(hostile.stdout).readline() == b"here\n"
        until(lambda: gateway.counters()["ros2_faults"] >= 3)
        ros_peer.advertise("control_stop_subprocess")
        ros_peer.publish("control_stop_subprocess", ros_peer.order("stop"))
        assert gateway.receive("command")[0].name == "stop_detection"
        hostile.communicate()
