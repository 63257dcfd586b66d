"""The real gateway process on the loopback, seen by a second participant."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import made
import pytest
from until import until

from uavrt.config.settings import Ros2Settings
from uavrt.core.messages import (
    Command,
    Poses,
    ProcessStatus,
    Pulse,
    PulsePose,
    StatusText,
    SystemStatus,
    Tag,
)
from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.ros_records import pulse_pose_to_ros, pulse_to_ros, tag_to_ros
from uavrt.link.ros2.types.cdr import encode
from uavrt.link.ros2.types.interface import full_name, type_hash

TAGS = tuple(
    made.tag(
        tag_id, 148.71e6 + 5e3 * tag_id, interval_uncertainty_s=0.06, interval_jitter_s=0.01
    )
    for tag_id in (2, 4, 6)
)

FLIGHT = made.flight_info(
    "/flights/flight_log_2026-05-01_08-15-00",
    TAGS,
    start_time_ns=1_777_623_300_000_000_000,
    center_frequency_hz=148.705e6,
)

POSE = made.pose(1_777_623_301_009_000_000, 47.0, 8.5, altitude_amsl_m=500.0)


def a_pulse(number: int) -> Pulse:
    return made.pulse_of_group(1_777_623_301_019_828_320, number, 148_720_012.5)


def a_status(time_ns: int, *processes: ProcessStatus) -> SystemStatus:
    return made.system_status(
        time_ns,
        flight_directory=FLIGHT.directory,
        center_frequency_hz=FLIGHT.center_frequency_hz,
        tags=TAGS,
        processes=processes,
    )


def a_process(
    name: str, *, running: bool = True, ok: bool = True, tag_ids: tuple[int, ...] = ()
) -> ProcessStatus:
    return made.process_status(
        name,
        "detecting" if ok else "radio absent",
        running=running,
        pid=4321 if running else None,
        ok=ok,
        cpu_s=1.0,
        memory_mb=50.0,
        tag_ids=tag_ids,
    )


def test_the_nodes_of_the_thesis_are_seen_and_vanish_at_the_end(
    launch: Any, ros_peer: Any
) -> None:
    infos = ros_peer.listen("ros_discovery_info")
    gateway = launch()
    info = infos.newest(lambda info: len(info.node_entities_info_seq) == 6)
    nodes = {node.node_name: node for node in info.node_entities_info_seq}
    assert set(nodes) == {
        "StartStopComponent",
        "AirspyCSDRNetcatComponent",
        "ChannelizerComponent",
        "DetectorComponent",
        "TelemetryComponent",
        "CommandComponent",
    }
    for name, node in nodes.items():
        assert node.node_namespace == "/"
        published = [t for t in TOPICS.values() if t.publisher == name]
        assert len(node.writer_gid_seq) == len(published) + 1  # and rosout
        subscribed = [t for t in TOPICS.values() if name in t.subscribers]
        assert len(node.reader_gid_seq) == len(subscribed)
    assert gateway.close() == 0
    infos.newest(lambda info: len(info.node_entities_info_seq) == 0)


LISTENER = """
import sys, time
sys.path.insert(0, sys.argv[2])
from ros_peer import RosPeer
infos = RosPeer(int(sys.argv[1])).listen("ros_discovery_info")
infos.newest()
print("received", flush=True)
time.sleep(60.0)
"""


def test_the_nodes_leave_although_another_program_answers_no_more(
    launch: Any, ros_domain: int
) -> None:
    gateway = launch()
    drivers = str(Path(__file__).parents[2] / "drivers")
    command = [sys.executable, "-c", LISTENER, str(ros_domain), drivers]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "received\n"
        os.kill(other.pid, signal.SIGSTOP)
        try:
            assert gateway.close() == 0
        finally:
            other.kill()


def test_every_topic_has_the_name_type_hash_and_quality_of_service_of_ros_2(
    launch: Any, ros_peer: Any
) -> None:
    launch()
    until(lambda: {f"rt/{name}" for name in TOPICS} <= set(ros_peer.endpoints()))
    endpoints = ros_peer.endpoints()
    for name, topic in TOPICS.items():
        endpoint = endpoints[f"rt/{name}"]
        package, _, short = full_name(topic.message).split("/")
        assert endpoint.type_name == f"{package}::msg::dds_::{short}_"
        policies = {policy.__scope__: policy for policy in endpoint.qos}
        assert policies["Userdata"].data == f"typehash={type_hash(topic.message)};".encode()
        assert "Reliable" in str(policies["Reliability"])
        assert "Volatile" in str(policies["Durability"])


def test_pulses_arrive_byte_for_byte_with_and_without_a_pose(
    launch: Any, ros_peer: Any
) -> None:
    pulses = ros_peer.listen("pulse")
    poses = ros_peer.listen("pulse_pose")
    gateway = launch(flight=FLIGHT)
    until(lambda: {"rt/pulse", "rt/pulse_pose"} <= set(ros_peer.endpoints()))
    gateway.receive("health")
    directory = f"{FLIGHT.directory}/detector_log/tag_id_2"
    sent = [a_pulse(number) for number in range(60)]
    # The reader and the writer have found each other when the first pulse comes through.
    pulses.collect(meanwhile=lambda: gateway.send("pulse", sent[0]))
    with_pose = PulsePose(pulse=sent[0], pose=POSE)
    poses.collect(meanwhile=lambda: gateway.send("pulse_pose", with_pose))
    for pulse in sent[1:]:
        gateway.send("pulse", pulse)
        gateway.send("pulse_pose", PulsePose(pulse=pulse, pose=None))
    last = encode(pulse_to_ros(sent[-1], directory))
    got = pulses.collect(lambda got: trimmed(got[-1], last))
    expected = [encode(pulse_to_ros(pulse, directory)) for pulse in sent[1:]]
    later = [cdr for cdr in got if not trimmed(cdr, encode(pulse_to_ros(sent[0], directory)))]
    assert len(later) == len(expected)
    for cdr, ours in zip(later, expected, strict=True):
        assert trimmed(cdr, ours)
    message = ros_peer.read(later[0], "pulse")
    assert message.frequency == pytest.approx(148.7200125)
    assert message.start_time.nanosec == sent[1].start_time_ns % 10**9
    absent = encode(pulse_pose_to_ros(PulsePose(pulse=sent[-1], pose=None), directory))
    posed = poses.collect(lambda got: trimmed(got[-1], absent))
    theirs = ros_peer.read(posed[-1], "pulse_pose")
    assert theirs.antenna_pose.position.x != theirs.antenna_pose.position.x


def trimmed(cdr: bytes, ours: bytes) -> bool:
    """Whether a sample is these bytes, with DDS's padding to four and nothing else."""
    return cdr[4 : len(ours)] == ours[4:] and cdr[len(ours) :].strip(b"\0") == b""


def test_tags_start_and_stop_become_commands_for_the_supervisor(
    launch: Any, ros_peer: Any
) -> None:
    gateway = launch()
    ros_peer.advertise("store_tag_information", "release_tag_information")
    ros_peer.advertise("control_start_subprocess", "control_stop_subprocess")
    for tag in TAGS:
        ros_peer.publish("store_tag_information", ros_peer.tag(tag_to_ros(tag)))
    commands = gateway.receive("command", 4)
    assert [c.name for c in commands] == ["start_tags", "add_tag", "add_tag", "add_tag"]
    assert [c.tag for c in commands[1:]] == list(TAGS)
    ros_peer.publish("release_tag_information", ros_peer.release())
    assert gateway.receive("command")[0].name == "end_tags"
    ros_peer.publish(
        "control_start_subprocess",
        ros_peer.order("start", center_frequency="148.705", gain="15"),
    )
    (start,) = gateway.receive("command")
    assert (start.name, start.source) == ("start_detection", "ros2")
    assert start.center_frequency_hz == pytest.approx(148.705e6)
    assert start.gain == 15
    ros_peer.publish("control_stop_subprocess", ros_peer.order("stop"))
    (stop,) = gateway.receive("command")
    assert stop.name == "stop_detection"
    numbers = [c.request_id for c in (*commands, start, stop)]
    assert sorted(set(numbers)) == numbers


def test_what_the_ground_asks_is_shown_as_the_original_passed_it_on(
    launch: Any, ros_peer: Any
) -> None:
    tags = ros_peer.listen("store_tag_information")
    start = ros_peer.listen("control_start_subprocess")
    detector = ros_peer.listen("control_detector_subprocess")
    gateway = launch()
    number = iter(range(1, 1000))

    def ask(name: str, tag: Tag | None = None) -> None:
        request: Any = Command(
            name=name,  # type: ignore[arg-type]
            request_id=next(number),
            tag=tag,
            source="mavlink 255/190",
        )
        gateway.send("command", request)

    start.collect(meanwhile=lambda: ask("start_detection"))
    tags.collect(meanwhile=lambda: ask("add_tag", TAGS[0]))
    ask("add_tag", TAGS[1])
    second = encode(tag_to_ros(TAGS[1]))
    # Some of the first tag may still be on their way.
    shown = tags.collect(lambda got: trimmed(got[-1], second))
    first_tag = encode(tag_to_ros(TAGS[0]))
    assert all(trimmed(cdr, first_tag) for cdr in shown[:-1])

    def fly() -> None:
        gateway.send("flight", FLIGHT)
        gateway.send("flight_end", FLIGHT)

    def ids(got: list[bytes]) -> set[str]:
        told = [ros_peer.read(cdr, "control_detector_subprocess") for cdr in got]
        return {message.status[0].hardware_id for message in told}

    each = detector.collect(lambda got: len(ids(got)) >= 4, fly)
    assert ids(each) == {"tag_id_2", "tag_id_4", "tag_id_6", "stop all"}


def test_status_has_numeric_levels_and_a_hardware_id_for_each_tag(
    launch: Any, ros_peer: Any
) -> None:
    names = ("airspy_csdr_netcat", "channelizer", "detector")
    reads = {name: ros_peer.listen(f"status_{name}_subprocess") for name in names}
    gateway = launch(flight=FLIGHT)

    def tell() -> None:
        gateway.send(
            "system_status",
            a_status(
                gateway.clock.now_ns(),
                a_process("receiver", ok=False),
                a_process("detector-1", tag_ids=(2,)),
                a_process("detector-2", running=False, tag_ids=(4, 6)),
            ),
        )

    found = {
        name: read.newest(lambda message: message.status, tell) for name, read in reads.items()
    }
    (radio,) = found["airspy_csdr_netcat"].status
    assert (radio.level, radio.message, radio.hardware_id) == (2, "dead", "airspy")
    (channelizer,) = found["channelizer"].status
    assert (channelizer.level, channelizer.message) == (1, "alive")
    assert [(s.level, s.message, s.hardware_id) for s in found["detector"].status] == [
        (0, "alive", "tag_id_2"),
        (2, "dead", "tag_id_4"),
        (2, "dead", "tag_id_6"),
    ]
    assert all(s.name == "detector_component" for s in found["detector"].status)
    assert found["detector"].header.frame_id == "status"


def test_detectors_that_live_beat_with_frequency_0_and_dead_ones_do_not(
    launch: Any, ros_peer: Any
) -> None:
    read = ros_peer.listen("pulse")
    gateway = launch(flight=FLIGHT)

    def tell() -> None:
        gateway.send(
            "system_status",
            a_status(
                gateway.clock.now_ns(),
                a_process("detector-1", tag_ids=(2, 6)),
                a_process("detector-2", running=False, tag_ids=(4,)),
            ),
        )

    def beats(got: list[bytes]) -> list[tuple[int, float]]:
        told = [ros_peer.read(cdr, "pulse") for cdr in got]
        return [(beat.tag_id, beat.frequency) for beat in told]

    def two_each(got: list[bytes]) -> bool:
        return all(beats(got).count((number, 0.0)) >= 2 for number in (2, 6))

    assert set(beats(read.collect(two_each, tell))) == {(2, 0.0), (6, 0.0)}


def test_the_antenna_s_pose_and_the_log_are_told(launch: Any, ros_peer: Any) -> None:
    poses = ros_peer.listen("antenna_pose")
    logs = ros_peer.listen("rosout")
    gateway = launch()
    gateway.send("status_text", StatusText(severity=3, text="radio absent"))
    here = Poses(poses=(POSE,))
    message = poses.newest(meanwhile=lambda: gateway.send("poses", here))
    assert message.header.frame_id == "antenna_pose"
    assert message.header.stamp.nanosec == POSE.time_ns % 10**9
    assert (message.pose.position.x, message.pose.position.y) == (47.0, 8.5)
    # The log reaches whoever comes late: it was written before we were found.
    line = ros_peer.read(logs.collect()[0], "rosout")
    assert (line.level, line.msg, line.name) == (40, "radio absent", "StartStopComponent")


def test_a_refused_command_is_told_with_its_reason(launch: Any, ros_peer: Any) -> None:
    logs = ros_peer.listen("rosout")
    gateway = launch()
    ros_peer.advertise("control_start_subprocess")
    ros_peer.publish("control_start_subprocess", ros_peer.order("start"))
    (command,) = gateway.receive("command")
    gateway.send(
        "command_reply", made.reply(command, message="no tags: send tags first", accepted=False)
    )
    line = logs.newest(lambda line: "refused" in line.msg)
    assert (line.level, line.msg) == (30, "start_detection refused: no tags: send tags first")


def test_nonsense_is_refused_and_counted_and_the_next_command_is_obeyed(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    gateway = launch()
    ros_peer.advertise("store_tag_information", "control_start_subprocess")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for port in (10, 11, 12, 13):
            for length in (0, 20, 1000):
                place = ("127.0.0.1", 7400 + 250 * ros_domain + port)
                stranger.sendto(b"RTPS\2\1" + b"\xff" * length, place)
    ros_peer.publish("store_tag_information", ros_peer.tag())
    ros_peer.publish("control_start_subprocess", ros_peer.order("launch the missiles"))
    ros_peer.publish("control_start_subprocess", ros_peer.order("start", gain="much"))
    empty = ros_peer.order("start")
    empty.status = []
    ros_peer.publish("control_start_subprocess", empty)
    ros_peer.publish("store_tag_information", ros_peer.tag(tag_to_ros(TAGS[0])))
    assert [c.name for c in gateway.receive("command", 2)] == ["start_tags", "add_tag"]

    until(lambda: gateway.counters()["ros2_messages_refused"] == 4)


def test_a_component_alone_is_neither_started_nor_stopped_and_says_so(
    launch: Any, ros_peer: Any
) -> None:
    status = ros_peer.listen("status_detector_subprocess")
    launch()
    ros_peer.advertise("control_detector_subprocess")
    stop = ros_peer.order("stop")
    (echo,) = status.newest(
        lambda message: message.status,
        lambda: ros_peer.publish("control_detector_subprocess", stop),
    ).status
    assert (echo.level, echo.hardware_id) == (2, "stop all")
    assert "control_stop_subprocess" in echo.message


def test_commands_are_not_obeyed_where_the_settings_forbid_them(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    gateway = launch(Ros2Settings(enabled=True, domain_id=ros_domain, accept_commands=False))
    ros_peer.advertise("control_stop_subprocess")
    ros_peer.publish("control_stop_subprocess", ros_peer.order("stop"))

    until(lambda: gateway.counters()["ros2_messages_refused"] == 1)
    assert gateway.counters()["ros2_commands"] == 0
