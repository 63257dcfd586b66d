"""A flight as rosbag2, read back by an independent reader."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import msgspec
import pytest
from command_line import Ran
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from some import some
from sql import sql

from uavrt.analysis.measure.bag import export_bag
from uavrt.config.settings import AntennaSettings, Settings
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import Command, CommandReply, Pose, Pulse, PulsePose, StatusText
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.integrated import IntegratedVerdict, write_integrated
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.link.ros2.graph import START_STOP, TOPICS
from uavrt.link.ros2.ros_records import pulse_pose_to_ros
from uavrt.link.ros2.types.cdr import encode
from uavrt.link.ros2.types.interface import type_hash

INTERFACES = Path(__file__).parents[3] / "ros" / "uavrt_interfaces" / "msg"
START_NS = 1_777_623_301_019_828_320
S = 10**9
STOP_NS = START_NS + 60 * S
TAG = made.tag()


def a_pulse(number: int) -> Pulse:
    return made.pulse_of_group(START_NS + 10**9, number, 148_710_012.5)


def a_pose(time_ns: int) -> Pose:
    return made.pose(time_ns, 47.4, 8.5, altitude_amsl_m=500.0)


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """A flight of 30 pulses, the last without a pose, on an antenna turned by 90°."""
    info = made.flight_info(
        tmp_path / "flight_log_2026-05-01_08-15-00",
        (TAG,),
        start_time_ns=START_NS,
        center_frequency_hz=148.705e6,
    )
    settings = Settings(antenna=AntennaSettings(yaw_offset_deg=90.0))
    recorder = FlightRecorder.create(info, settings)
    pulses = [a_pulse(number) for number in range(30)]
    recorder.write_pulses(pulses)
    recorder.write_pulses(
        PulsePose(pulse=pulse, pose=a_pose(pulse.start_time_ns) if number < 29 else None)
        for number, pulse in enumerate(pulses)
    )
    recorder.write(*(a_pose(START_NS + number * 50_000_000) for number in range(100)))
    recorder.write_status_text(StatusText(severity=4, text="radio absent"), START_NS + 5)
    recorder.write(made.search_report(2, START_NS + 2 * 10**9, noise_psd=1e-9))
    for number, accepted in ((1, False), (2, True)):
        stop = Command(name="stop_detection", request_id=number, source="ros2")
        reply = CommandReply(request_id=number, name=stop.name, accepted=accepted, message="")
        recorder.write_command(stop, reply, STOP_NS - 2 * S + number * S)
    recorder.close()
    return Path(info.directory)


@pytest.fixture
def types() -> Any:
    """The messages as the ament package and rosbags have them."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for path in INTERFACES.glob("*.msg"):
        name = f"uavrt_interfaces/msg/{path.stem}"
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), name))
    return store


def test_every_pulse_of_a_flight_is_in_the_bag_byte_for_byte(
    flight: Path, tmp_path: Path, types: Any
) -> None:
    bag = export_bag(flight, tmp_path / "bag")
    with AnyReader([bag.directory], default_typestore=types) as reader:
        got = {
            name: [(time, bytes(raw)) for c, time, raw in reader.messages() if c.topic == name]
            for name in ("/pulse", "/pulse_pose")
        }
    recorded = read_flight(flight).pulse_poses
    directory = str(flight / "detector_log" / "tag_id_2")
    assert [raw for _, raw in got["/pulse_pose"]] == [
        encode(pulse_pose_to_ros(item, directory)) for item in recorded
    ]
    assert [time for time, _ in got["/pulse_pose"]] == [
        item.pulse.end_time_ns for item in recorded
    ]
    read = [
        types.deserialize_cdr(raw, "uavrt_interfaces/msg/Pulse") for _, raw in got["/pulse"]
    ]
    assert [m.frequency for m in read].count(0.0) == 1  # "searched, nothing found"
    assert len(read) == 31
    last = types.deserialize_cdr(got["/pulse_pose"][-1][1], "uavrt_interfaces/msg/PulsePose")
    assert math.isnan(last.antenna_pose.position.x)


def test_pulses_seen_in_hindsight_are_apart_from_those_that_were_heard(
    flight: Path, tmp_path: Path, types: Any
) -> None:
    heard = read_flight(flight).pulse_poses[0]
    late = replace(heard.pulse, detection_status="integrated", confirmed=False)
    verdict = IntegratedVerdict(
        tag_id=2, found=True, false_alarm_probability=1e-6, interval_s=1.2, frequency_hz=148.7e6
    )
    before = export_bag(flight, tmp_path / "before")
    write_integrated(flight, [verdict], [replace(heard, pulse=late)])
    bag = export_bag(flight, tmp_path / "bag")
    assert bag.messages == before.messages | {"integrated/pulse": 1, "integrated/pulse_pose": 1}
    with AnyReader([bag.directory], default_typestore=types) as reader:
        ((topic, raw),) = [
            (c, bytes(raw))
            for c, _, raw in reader.messages()
            if c.topic == "/integrated/pulse_pose"
        ]
    assert topic.msgtype == "uavrt_interfaces/msg/PulsePose"
    read = types.deserialize_cdr(raw, topic.msgtype)
    assert not read.pulse.confirmed_status


def test_the_bag_says_types_hashes_and_quality_of_service(flight: Path, tmp_path: Path) -> None:
    bag = export_bag(flight, tmp_path / "bag")
    with Reader(bag.directory) as reader:
        topics = {connection.topic[1:]: connection for connection in reader.connections}
        assert reader.message_count == sum(bag.messages.values())
        assert {name: topic.msgcount for name, topic in topics.items()} == bag.messages
    for name, connection in topics.items():
        (qos,) = connection.ext.offered_qos_profiles
        assert qos.reliability is QosReliability.RELIABLE
        late = name == "rosout"
        kept = QosDurability.TRANSIENT_LOCAL if late else QosDurability.VOLATILE
        assert qos.durability is kept
        if not late:
            live = name.removeprefix("recorded/")
            assert connection.digest == type_hash(TOPICS[live].message)
    assert set(topics) == {
        "pulse",
        "pulse_pose",
        "antenna_pose",
        "recorded/store_tag_information",
        "recorded/release_tag_information",
        "recorded/control_start_subprocess",
        "recorded/control_stop_subprocess",
        "rosout",
    }


def test_no_order_in_a_bag_is_on_a_topic_that_a_drone_obeys(
    flight: Path, tmp_path: Path
) -> None:
    obeyed = {name for name, topic in TOPICS.items() if START_STOP in topic.subscribers}
    assert not obeyed & set(export_bag(flight, tmp_path / "bag").messages)
    obeyed.remove("store_coded_tag_information")  # the flight's tags beep
    assert obeyed <= set(export_bag(flight, tmp_path / "sent", as_sent=True).messages)


def test_a_bag_has_the_stop_that_ended_the_flight(
    flight: Path, tmp_path: Path, types: Any
) -> None:
    bag = export_bag(flight, tmp_path / "bag")
    with AnyReader([bag.directory], default_typestore=types) as reader:
        name = "/recorded/control_stop_subprocess"
        (connection,) = (c for c in reader.connections if c.topic == name)
        ((_, time_ns, raw),) = reader.messages([connection])
        message: Any = reader.deserialize(raw, connection.msgtype)
    assert time_ns == STOP_NS
    assert message.status[0].message == "stop"
    assert message.header.frame_id == "stop_command_subprocesses"


def test_the_file_alone_is_read_too_and_describes_itself(
    flight: Path, tmp_path: Path, types: Any
) -> None:
    from mcap.reader import make_reader

    bag = export_bag(flight, tmp_path / "bag")
    with bag.file.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        times = [message.log_time for _, _, message in reader.iter_messages()]
        (described,) = reader.iter_metadata()
        summary = reader.get_summary()
    assert times == sorted(times)
    assert {schema.encoding for schema in some(summary).schemas.values()} == {"ros2msg"}
    inside = json.loads(described.metadata["serialized_metadata"])
    assert inside == json.loads((bag.directory / "metadata.yaml").read_text(encoding="utf-8"))
    with AnyReader([bag.file], default_typestore=types) as whole:
        assert whole.message_count == len(times)


def test_the_antenna_s_pose_has_the_mounting_in_it(
    flight: Path, tmp_path: Path, types: Any
) -> None:
    bag = export_bag(flight, tmp_path / "bag")
    with AnyReader([bag.directory], default_typestore=types) as reader:
        (connection,) = (c for c in reader.connections if c.topic == "/antenna_pose")
        _, _, raw = next(reader.messages([connection]))
        message: Any = reader.deserialize(raw, connection.msgtype)
    assert message.header.frame_id == "antenna_pose"
    orientation = message.pose.orientation
    # North-looking vehicle, antenna 90° to the right: half an angle of 45°.
    assert orientation.w == pytest.approx(math.sqrt(0.5))
    assert orientation.z == pytest.approx(math.sqrt(0.5))


def test_a_bag_is_not_written_over_another(flight: Path, tmp_path: Path) -> None:
    export_bag(flight, tmp_path / "bag")
    with pytest.raises(UsageError, match="does not exist yet"):
        export_bag(flight, tmp_path / "bag")


def test_settings_of_the_flight_that_cannot_be_read_are_named(
    flight: Path, tmp_path: Path
) -> None:
    sql(flight, "UPDATE flight SET settings = '{]'")
    with pytest.raises(FormatError, match="settings"):
        export_bag(flight, tmp_path / "bag")


def test_a_settings_record_travels_as_the_recorder_writes_it(flight: Path) -> None:
    text = read_flight(flight).settings_json
    assert msgspec.json.decode(some(text), type=Settings).antenna.yaw_offset_deg == 90.0


def test_the_command_writes_into_the_flight_and_lists_the_topics(
    flight: Path, ran: Ran
) -> None:
    assert "30  /pulse_pose" in ran("export", flight, "--mcap").out
    assert (flight / "bag" / "bag_0.mcap").exists()
