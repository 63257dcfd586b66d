"""The ROS 2 messages of uavrt, as dataclasses.

The .msg text, the type hash, the bytes and the DDS type derive from the annotations
(`uavrt.link.ros2.types.interface`, `uavrt.link.ros2.types.cdr`). Field names, order and units
are the original system's, so that its nodes interoperate; the standard types are those of ROS 2
Humble to Kilted. An absent number is NaN, an absent time is zero.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, ClassVar, TypeVar, dataclass_transform

Bool = Annotated[bool, "bool"]
Byte = Annotated[int, "byte"]
UInt8 = Annotated[int, "uint8"]
UInt16 = Annotated[int, "uint16"]
Int32 = Annotated[int, "int32"]
UInt32 = Annotated[int, "uint32"]
Float64 = Annotated[float, "float64"]
String = Annotated[str, "string"]


class RosMessage:
    """Base of all messages; `ros_name` is package and type."""

    __slots__: ClassVar[tuple[str, ...]] = ()
    ros_name: ClassVar[str]
    interface: ClassVar[str] = "msg"
    """Kind of interface: ``msg``, or ``srv`` for requests and replies of services."""


M = TypeVar("M", bound=RosMessage)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def ros_message(ros_name: str) -> Callable[[type[M]], type[M]]:
    """Decorator that makes a frozen dataclass a message of this package and type."""

    def made(kind: type[M]) -> type[M]:
        kind.ros_name = ros_name
        return dataclass(frozen=True, slots=True, kw_only=True)(kind)

    return made


@ros_message("builtin_interfaces/Time")
class Time(RosMessage):
    """A time: seconds UTC since 1970, and nanoseconds."""

    sec: Int32 = 0
    nanosec: UInt32 = 0


@ros_message("std_msgs/Header")
class Header(RosMessage):
    """Time and frame of a message; `frame_id` holds the kind of the message."""

    stamp: Time = Time()
    frame_id: String = ""


@ros_message("std_msgs/Bool")
class Flag(RosMessage):
    """A message with one truth value (std_msgs/Bool)."""

    data: Bool = False


@ros_message("geometry_msgs/Point")
class Point(RosMessage):
    """A position: latitude [deg], longitude [deg], altitude above mean sea level [m]."""

    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0


@ros_message("geometry_msgs/Quaternion")
class Quaternion(RosMessage):
    """Rotation from the antenna frame (forward, right, down) to north-east-down."""

    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0
    w: Float64 = 1.0


@ros_message("geometry_msgs/Pose")
class RosPose(RosMessage):
    """Position and orientation."""

    position: Point = Point()
    orientation: Quaternion = Quaternion()


@ros_message("geometry_msgs/PoseStamped")
class PoseStamped(RosMessage):
    """A pose and its time."""

    header: Header = Header()
    pose: RosPose = RosPose()


@ros_message("diagnostic_msgs/KeyValue")
class KeyValue(RosMessage):
    """A named value, both as text."""

    key: String = ""
    value: String = ""


@ros_message("diagnostic_msgs/DiagnosticStatus")
class DiagnosticStatus(RosMessage):
    """State of one component; the levels are numbers, not the characters '0' and '2'."""

    level: Byte = 0
    name: String = ""
    message: String = ""
    hardware_id: String = ""
    values: tuple[KeyValue, ...] = ()


OK, WARN, ERROR, STALE = 0, 1, 2, 3
"""Values of a `DiagnosticStatus`'s level, as in diagnostic_msgs."""


@ros_message("diagnostic_msgs/DiagnosticArray")
class DiagnosticArray(RosMessage):
    """States of several components, or an order to one (``start``, ``stop``)."""

    header: Header = Header()
    status: tuple[DiagnosticStatus, ...] = ()


@ros_message("rcl_interfaces/Log")
class Log(RosMessage):
    """A line of ``/rosout``; levels 10 debug, 20 info, 30 warn, 40 error, 50 fatal."""

    stamp: Time = Time()
    level: UInt8 = 20
    name: String = ""
    msg: String = ""
    file: String = ""
    function: String = ""
    line: UInt32 = 0


@ros_message("uavrt_interfaces/Pulse")
class RosPulse(RosMessage):
    """A pulse of a tag; with a frequency of 0 the heartbeat of its detector."""

    detector_dir: String = ""
    tag_id: UInt32 = 0
    frequency: Float64 = 0.0
    """Frequency of the pulse [MHz]; 0 in a heartbeat."""
    start_time: Time = Time()
    end_time: Time = Time()
    predict_next_start: Time = Time()
    predict_next_end: Time = Time()
    snr: Float64 = 0.0
    """SNR of the pulse [dB]."""
    stft_score: Float64 = 0.0
    group_ind: UInt16 = 0
    group_snr: Float64 = 0.0
    """SNR of the pulse's group [dB]."""
    detection_status: Bool = False
    confirmed_status: Bool = False


@ros_message("uavrt_interfaces/PulsePose")
class RosPulsePose(RosMessage):
    """A pulse and the antenna's pose at its centre; all NaN where no pose is known."""

    pulse: RosPulse = RosPulse()
    antenna_pose: RosPose = RosPose()


@ros_message("uavrt_interfaces/Tag")
class RosTag(RosMessage):
    """A tag to search for: frequency in Hz, times in ms."""

    tag_id: UInt32 = 0
    frequency: Float64 = 0.0
    pulse_duration: Float64 = 0.0
    interpulse_time_1: Float64 = 0.0
    interpulse_time_uncert: Float64 = 0.0
    interpulse_time_jitter: Float64 = 0.0
    interpulse_time_2: Float64 = 0.0
    k: UInt32 = 0
    false_alarm_probability: Float64 = 0.0


@ros_message("uavrt_interfaces/Burst")
class RosBurst(RosMessage):
    """A coded tag's burst: its pulse message, and the pulses in it."""

    pulse: RosPulse = RosPulse()
    starts: tuple[Time, ...] = ()
    snrs: tuple[Float64, ...] = ()
    """SNR of each pulse in the burst [dB]."""
    also_possible_tag_ids: tuple[UInt32, ...] = ()


@ros_message("uavrt_interfaces/CodedTag")
class RosCodedTag(RosMessage):
    """A coded tag to search for; its one interval is that from burst to burst."""

    tag: RosTag = RosTag()
    gaps: tuple[Float64, ...] = ()
    """Times between the pulses of a burst [ms]."""


@lru_cache
def graph_messages(gid_bytes: int) -> tuple[type[Any], type[Any], type[Any]]:
    """Message types that announce nodes and endpoints, by the size of identifiers.

    ROS 2 reads the names of nodes from these messages. Identifiers have 16 bytes since Iron, 24
    from Foxy to Humble.
    """

    @ros_message("rmw_dds_common/Gid")
    class Gid(RosMessage):
        data: Annotated[bytes, gid_bytes] = bytes(gid_bytes)

    @ros_message("rmw_dds_common/NodeEntitiesInfo")
    class NodeEntitiesInfo(RosMessage):
        node_namespace: Annotated[str, "string<=256"] = "/"
        node_name: Annotated[str, "string<=256"] = ""
        reader_gid_seq: tuple[Gid, ...] = ()
        writer_gid_seq: tuple[Gid, ...] = ()

    @ros_message("rmw_dds_common/ParticipantEntitiesInfo")
    class ParticipantEntitiesInfo(RosMessage):
        gid: Gid = Gid()
        node_entities_info_seq: tuple[NodeEntitiesInfo, ...] = ()

    return Gid, NodeEntitiesInfo, ParticipantEntitiesInfo
