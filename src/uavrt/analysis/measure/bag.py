"""Export a flight as a rosbag2 recording in MCAP format, as if ROS 2 had recorded it live.

It contains the gateway's topics with the same messages, types and bytes; ``ros2 bag play`` and
Foxglove can open it. Small chunks and an index make seeking fast in a large flight.
"""

import heapq
import json
import math
import os
import shutil
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavrt.analysis.inputs.flown_with import antenna_poses
from uavrt.core.errors import FormatError, UsageError, needs_extra, os_errors_as
from uavrt.core.messages import FlightInfo, PulsePose, StatusText
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.integrated import read_integrated
from uavrt.flight.reading.flight_reader import (
    Flight,
    read_flight,
    read_search_reports,
    read_stops,
)
from uavrt.link.ros2.drone_state import LOG_LEVELS
from uavrt.link.ros2.graph import LOG_DEPTH, LOG_MESSAGE, LOG_TOPIC, START_STOP, TOPICS
from uavrt.link.ros2.ros_records import (
    burst_to_ros,
    coded_tag_to_ros,
    heartbeat,
    key_values,
    pose_stamped,
    pulse_pose_to_ros,
    pulse_to_ros,
    tag_to_ros,
    time_to_ros,
)
from uavrt.link.ros2.types.cdr import encode
from uavrt.link.ros2.types.interface import full_definition, full_name, type_hash
from uavrt.link.ros2.types.ros_messages import (
    DiagnosticArray,
    DiagnosticStatus,
    Flag,
    Header,
    Log,
    RosMessage,
)

CHUNK_BYTES = 65536
RECORDED = "recorded/"
"""Topic prefix of motion orders in a bag, so that no gateway obeys a played bag."""
HINDSIGHT = "integrated/"
"""Topic prefix in a bag for pulses that ``uavrt integrate`` found."""
METADATA_VERSION = 5
"""Version of rosbag2's ``metadata.yaml``: that of ROS 2 Humble, read by later ones."""

Entry = tuple[int, str, RosMessage]
"""A message to be written to a bag: time [ns, UTC], topic and message."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bag:
    """Directory, file and message counts of a written ROS 2 bag."""

    directory: Path
    file: Path
    messages: dict[str, int]
    """Number of messages written to the bag, by topic."""


def export_bag(
    flight_directory: str | os.PathLike[str], target: Path, *, as_sent: bool = False
) -> Bag:
    """Write a flight as a rosbag2 recording into the directory `target`.

    Playing a recording must not command a drone, so motion orders get the topic prefix
    `RECORDED` unless `as_sent`. Pulses found by ``uavrt integrate`` get the prefix
    `HINDSIGHT`.
    """
    flight = read_flight(flight_directory)
    _, integrated = read_integrated(flight_directory)
    prefix = "" if as_sent else RECORDED
    entries = heapq.merge(
        _orders(flight.info, prefix),
        _stops(read_stops(flight_directory), prefix),
        _pulses(flight.info, flight.pulse_poses),
        _pulses(flight.info, integrated, HINDSIGHT),
        _heartbeats(Path(flight_directory), flight.info),
        _poses(flight),
        _logs(flight.status_texts),
        key=lambda entry: entry[0],
    )
    with os_errors_as(
        UsageError,
        f"cannot make {target}",
        "Name a directory that does not exist yet, in a place where you can write",
    ):
        target.mkdir(parents=True)
    file = target / f"{target.name}_0.mcap"
    try:
        text, counts = write_mcap(file, entries)
        (target / "metadata.yaml").write_text(text, encoding="utf-8")
    except BaseException as error:
        shutil.rmtree(target)  # half of it would be in the way of the next try
        if isinstance(error, ValueError | TypeError | OverflowError | struct.error):
            raise FormatError(
                f"{flight_directory} has a value that ROS 2 messages cannot represent: {error}",
                remedy="Export it in another format",
            ) from error
        raise
    return Bag(directory=target, file=file, messages=dict(counts))


def write_mcap(path: Path, entries: Iterable[Entry]) -> tuple[str, Counter[str]]:
    """Write messages into an MCAP file; return rosbag2's description and message counts."""
    with needs_extra("analysis", "MCAP"):
        from mcap.writer import CompressionType, Writer
    counts: Counter[str] = Counter()
    first_ns = last_ns = 0
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="uavrt")
        channels: dict[str, int] = {}
        for time_ns, topic, message in entries:
            if topic not in channels:
                channels[topic] = _register(writer, topic, type(message))
            first_ns, last_ns = (first_ns if counts else time_ns), time_ns
            counts[topic] += 1
            writer.add_message(
                channel_id=channels[topic],
                log_time=time_ns,
                publish_time=time_ns,
                data=encode(message),
                sequence=counts[topic],
            )
        text = _metadata(path.name, counts, first_ns, last_ns)
        writer.add_metadata("rosbag2", {"serialized_metadata": text})
        writer.finish()
    return text, counts


def _register(writer: Any, topic: str, message: type[RosMessage]) -> int:
    schema_id = writer.register_schema(
        name=full_name(message), encoding="ros2msg", data=full_definition(message).encode()
    )
    channel: int = writer.register_channel(
        topic=f"/{topic}",
        message_encoding="cdr",
        schema_id=schema_id,
        metadata={
            "offered_qos_profiles": _qos_yaml(topic),
            "topic_type_hash": type_hash(message),
        },
    )
    return channel


# ------------------------------------------------------------------- the flight


def _orders(info: FlightInfo, prefix: str) -> Iterator[Entry]:
    start_ns = info.start_time_ns
    for tag in info.tags:
        if tag.coded:
            yield start_ns, f"{prefix}store_coded_tag_information", coded_tag_to_ros(tag)
        else:
            yield start_ns, f"{prefix}store_tag_information", tag_to_ros(tag)
    yield start_ns, f"{prefix}release_tag_information", Flag(data=True)
    center = {}
    if math.isfinite(info.center_frequency_hz):  # a ground station does not know it
        center = {"center_frequency": f"{info.center_frequency_hz / 1e6:.6f}"}
    yield start_ns, f"{prefix}control_start_subprocess", _order("start", start_ns, center)


def _stops(times_ns: Iterable[int], prefix: str) -> Iterator[Entry]:
    for time_ns in times_ns:
        yield time_ns, f"{prefix}control_stop_subprocess", _order("stop", time_ns, {})


def _order(what: str, time_ns: int, values: Mapping[str, object]) -> DiagnosticArray:
    status = DiagnosticStatus(
        name="NA", message=what, hardware_id=f"{what} all", values=key_values(values)
    )
    frame = f"{what}_command_subprocesses"
    header = Header(stamp=time_to_ros(time_ns), frame_id=frame)
    return DiagnosticArray(header=header, status=(status,))


def _pulses(
    info: FlightInfo, pulse_poses: Iterable[PulsePose], prefix: str = ""
) -> Iterator[Entry]:
    """Messages of each pulse on the live topics: pulse, burst if coded, pulse with pose."""
    for item in sorted(pulse_poses, key=lambda item: item.pulse.end_time_ns):
        directory = _tag_directory(info, item.pulse.tag_id)
        time_ns = item.pulse.end_time_ns
        yield time_ns, f"{prefix}pulse", pulse_to_ros(item.pulse, directory)
        if item.pulse.burst_starts_ns:
            yield time_ns, f"{prefix}burst", burst_to_ros(item.pulse, directory)
        yield time_ns, f"{prefix}pulse_pose", pulse_pose_to_ros(item, directory)


def _heartbeats(directory: Path, info: FlightInfo) -> Iterator[Entry]:
    for report in read_search_reports(directory):
        path = _tag_directory(info, report.tag_id)
        beat = heartbeat(report.tag_id, report.time_ns, path)
        yield report.time_ns, "pulse", beat


def _poses(flight: Flight) -> Iterator[Entry]:
    for pose in antenna_poses(flight):
        yield pose.time_ns, "antenna_pose", pose_stamped(pose)


def _logs(texts: Iterable[tuple[int, StatusText]]) -> Iterator[Entry]:
    for time_ns, text in texts:
        message = Log(
            stamp=time_to_ros(time_ns),
            level=LOG_LEVELS[max(0, min(7, text.severity))],
            name=START_STOP,
            msg=text.text,
        )
        yield time_ns, LOG_TOPIC, message


def _tag_directory(info: FlightInfo, tag_id: int) -> str:
    return str(FlightLayout(Path(info.directory)).tag_directory(tag_id))


# ------------------------------------------------------------------ metadata.yaml


def _metadata(file: str, counts: Counter[str], first_ns: int, last_ns: int) -> str:
    total = sum(counts.values())
    start = {"nanoseconds_since_epoch": first_ns}
    duration = {"nanoseconds": last_ns - first_ns}
    topics = [
        {
            "topic_metadata": {
                "name": f"/{topic}",
                "type": full_name(_message_of(topic)),
                "serialization_format": "cdr",
                "offered_qos_profiles": _qos_yaml(topic),
                # A key of later formats; earlier readers pass over it.
                "type_description_hash": type_hash(_message_of(topic)),
            },
            "message_count": count,
        }
        for topic, count in sorted(counts.items())
    ]
    described = {
        "rosbag2_bagfile_information": {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            "duration": duration,
            "starting_time": start,
            "message_count": total,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [file],
            "files": [
                {
                    "path": file,
                    "starting_time": start,
                    "duration": duration,
                    "message_count": total,
                }
            ],
        }
    }
    return json.dumps(described, indent=2) + "\n"


def _qos_yaml(topic: str) -> str:
    """Quality-of-service settings of a topic as YAML, with the numeric codes of ROS 2's rmw."""
    forever = {"sec": 9223372036, "nsec": 854775807}
    late = topic == LOG_TOPIC
    return json.dumps(
        [
            {
                "history": 1,
                "depth": LOG_DEPTH if late else TOPICS[_live(topic)].depth,
                "reliability": 1,
                "durability": 1 if late else 2,
                "deadline": forever,
                "lifespan": forever,
                "liveliness": 1,
                "liveliness_lease_duration": forever,
                "avoid_ros_namespace_conventions": False,
            }
        ]
    )


def _message_of(topic: str) -> type[RosMessage]:
    return LOG_MESSAGE if topic == LOG_TOPIC else TOPICS[_live(topic)].message


def _live(topic: str) -> str:
    return topic.removeprefix(RECORDED).removeprefix(HINDSIGHT)
