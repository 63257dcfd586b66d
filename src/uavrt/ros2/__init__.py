"""ROS 2: the drone side as nodes and topics, without installing ROS.

Only `uavrt.ros2.dds` needs the extra ``uavrt[ros2]``; messages, bytes and type hashes do not.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ros2.cdr import decode, encode
    from uavrt.ros2.convert import (
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
    from uavrt.ros2.dds import Participant
    from uavrt.ros2.gateway import LOG_LEVELS, Gateway
    from uavrt.ros2.graph import (
        DETECTOR,
        LOG_DEPTH,
        LOG_MESSAGE,
        LOG_TOPIC,
        NODES,
        START_STOP,
        TOPICS,
        RosTopic,
    )
    from uavrt.ros2.interface import definition, full_definition, full_name, type_hash
    from uavrt.ros2.messages import (
        DiagnosticArray,
        DiagnosticStatus,
        Flag,
        Header,
        Log,
        RosMessage,
    )

__all__ = [
    "DETECTOR",
    "LOG_DEPTH",
    "LOG_LEVELS",
    "LOG_MESSAGE",
    "LOG_TOPIC",
    "NODES",
    "START_STOP",
    "TOPICS",
    "DiagnosticArray",
    "DiagnosticStatus",
    "Flag",
    "Gateway",
    "Header",
    "Log",
    "Participant",
    "RosMessage",
    "RosTopic",
    "burst_to_ros",
    "coded_tag_to_ros",
    "decode",
    "definition",
    "encode",
    "full_definition",
    "full_name",
    "heartbeat",
    "key_values",
    "pose_stamped",
    "pulse_pose_to_ros",
    "pulse_to_ros",
    "tag_to_ros",
    "time_to_ros",
    "type_hash",
]
__getattr__ = lazily(
    __name__,
    {
        "DETECTOR": "graph",
        "DiagnosticArray": "messages",
        "DiagnosticStatus": "messages",
        "Flag": "messages",
        "Gateway": "gateway",
        "Header": "messages",
        "LOG_DEPTH": "graph",
        "LOG_LEVELS": "gateway",
        "LOG_MESSAGE": "graph",
        "LOG_TOPIC": "graph",
        "Log": "messages",
        "NODES": "graph",
        "Participant": "dds",
        "RosMessage": "messages",
        "RosTopic": "graph",
        "START_STOP": "graph",
        "TOPICS": "graph",
        "decode": "cdr",
        "definition": "interface",
        "encode": "cdr",
        "full_definition": "interface",
        "full_name": "interface",
        "heartbeat": "convert",
        "key_values": "convert",
        "pose_stamped": "convert",
        "pulse_pose_to_ros": "convert",
        "pulse_to_ros": "convert",
        "burst_to_ros": "convert",
        "coded_tag_to_ros": "convert",
        "tag_to_ros": "convert",
        "time_to_ros": "convert",
        "type_hash": "interface",
    },
)
