"""Tables of the ROS 2 nodes of the drone and of the topics between them.

Nodes and topics are those of the original system (thesis Fig. 2.1), so that its tools work with
uavrt. Endpoints, type hashes and documentation are generated from the tables. `OWN_TOPICS` are
additional topics.
"""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import Any

from uavrt.core.messages import PulsePose
from uavrt.link.ros2.ros_records import pulse_pose_to_ros
from uavrt.link.ros2.types.ros_messages import (
    DiagnosticArray,
    Flag,
    Log,
    PoseStamped,
    RosBurst,
    RosCodedTag,
    RosMessage,
    RosPulse,
    RosPulsePose,
    RosTag,
)

TELEMETRY = "TelemetryComponent"
COMMAND = "CommandComponent"
START_STOP = "StartStopComponent"
AIRSPY = "AirspyCSDRNetcatComponent"
CHANNELIZER = "ChannelizerComponent"
DETECTOR = "DetectorComponent"

NODES: dict[str, str] = {
    TELEMETRY: "the antenna's pose; pulses with their pose",
    COMMAND: "the ground station's commands",
    START_STOP: "the supervisor's state",
    AIRSPY: "the radio",
    CHANNELIZER: "the receiver",
    DETECTOR: "the detectors",
}
"""Name and purpose of each ROS 2 node, in the order of the data flow."""

PARAMETER_NODE = START_STOP
"""Node that serves the drone's parameters, if services are enabled."""


def detector_node(tag_id: int) -> str:
    """Return the name of the ROS 2 node of a tag's detector."""
    return f"Detector_tag_{tag_id}"


Conversion = Callable[[Any, Callable[[int], str]], RosMessage]
"""Function that makes a ROS 2 message from a record; it also gets each tag's directory in the
flight, by tag id."""


@dataclass(frozen=True, slots=True)
class RosTopic:
    """A ROS 2 topic: message type, publisher, subscribers and rate limits."""

    name: str
    message: type[RosMessage]
    publisher: str
    meaning: str
    _: KW_ONLY
    subscribers: tuple[str, ...] = ()
    depth: int = 10
    """Number of the topic's latest messages that a late subscriber receives."""
    burst: int = 20
    """Largest number of messages accepted at once (`uavrt.link.ros2.inbox`); 0: the topic
    accepts no messages."""
    per_s: float = 2.0
    """Rate at which the topic's messages are accepted after a burst [1/s]."""
    commands: bool = True
    """True if messages of this topic are commands, which are handled before data messages."""
    made_of: tuple[type, Conversion] | None = None
    """Type of the records published on arrival; None if `DroneTopics` decides when to
    publish."""


UPLOAD_BURST, UPLOAD_PER_S = 400, 10.0
"""Tag messages accepted at once, and per second; enough for a hundred tags sent three times."""
SERVICE_BURST, SERVICE_PER_S = 100, 10.0
"""Parameter requests accepted at once, and per second; clients read all several times."""

TOPICS: dict[str, RosTopic] = {
    topic.name: topic
    for topic in (
        RosTopic(
            "antenna_pose",
            PoseStamped,
            TELEMETRY,
            "the antenna's position and orientation, twice a second",
        ),
        RosTopic(
            "pulse",
            RosPulse,
            DETECTOR,
            "a pulse as detected; with frequency 0 a detector's heartbeat",
            subscribers=(TELEMETRY,),
            # A group of K pulses of many tags comes at once; ten would not outlast a lost
            # datagram.
            depth=100,
            # Groups of three pulses of a hundred tags, and their detectors' signs of life.
            burst=400,
            per_s=200.0,
            commands=False,
        ),
        RosTopic(
            "burst",
            RosBurst,
            DETECTOR,
            "the pulses inside a coded tag's burst, itself a pulse elsewhere",
            depth=100,
        ),
        RosTopic(
            "pulse_pose",
            RosPulsePose,
            TELEMETRY,
            "a pulse with the antenna's pose at its centre",
            subscribers=(COMMAND,),
            depth=100,
            burst=0,
            per_s=0.0,
            commands=False,
            made_of=(
                PulsePose,
                lambda one, folder: pulse_pose_to_ros(one, folder(one.pulse.tag_id)),
            ),
        ),
        RosTopic(
            "control_start_subprocess",
            DiagnosticArray,
            COMMAND,
            "start detecting",
            subscribers=(START_STOP,),
        ),
        RosTopic(
            "control_stop_subprocess",
            DiagnosticArray,
            COMMAND,
            "stop detecting",
            subscribers=(START_STOP,),
        ),
        RosTopic(
            "store_tag_information",
            RosTag,
            COMMAND,
            "a tag to search for",
            subscribers=(START_STOP,),
            depth=200,
            burst=UPLOAD_BURST,
            per_s=UPLOAD_PER_S,
        ),
        RosTopic(
            "store_coded_tag_information",
            RosCodedTag,
            COMMAND,
            "a coded tag to search for",
            subscribers=(START_STOP,),
            depth=200,
            burst=UPLOAD_BURST,
            per_s=UPLOAD_PER_S,
        ),
        RosTopic(
            "release_tag_information",
            Flag,
            COMMAND,
            "end of the tag upload",
            subscribers=(START_STOP,),
        ),
        RosTopic(
            "control_airspy_csdr_netcat_subprocess",
            DiagnosticArray,
            START_STOP,
            "the radio is started or stopped",
            subscribers=(AIRSPY,),
        ),
        RosTopic(
            "control_channelizer_subprocess",
            DiagnosticArray,
            START_STOP,
            "the receiver is started or stopped",
            subscribers=(CHANNELIZER,),
        ),
        RosTopic(
            "control_detector_subprocess",
            DiagnosticArray,
            START_STOP,
            "a tag's detector is started; all are stopped",
            subscribers=(DETECTOR,),
            depth=200,
        ),
        RosTopic(
            "status_airspy_csdr_netcat_subprocess",
            DiagnosticArray,
            AIRSPY,
            "the radio's state, twice a second; an echo after each control message",
        ),
        RosTopic(
            "status_channelizer_subprocess",
            DiagnosticArray,
            CHANNELIZER,
            "the receiver's state, twice a second; an echo after each control message",
        ),
        RosTopic(
            "status_detector_subprocess",
            DiagnosticArray,
            DETECTOR,
            "each tag's detector, twice a second; an echo after each control message",
        ),
    )
}

OWN_TOPICS = ("burst", "store_coded_tag_information")
"""Topics of coded tags, which the original system does not have."""

COMPONENTS = {"airspy_csdr_netcat": AIRSPY, "channelizer": CHANNELIZER, "detector": DETECTOR}
"""ROS 2 node of each component. A component has the topics ``control_…`` and
``status_<name>_subprocess``."""

LOG_TOPIC = "rosout"
"""Topic to which every node writes its log; late subscribers get the newest `LOG_DEPTH`."""
LOG_MESSAGE = Log
LOG_DEPTH = 1000
