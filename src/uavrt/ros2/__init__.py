"""ROS 2: the drone side as nodes and topics, without an installation of ROS.

`uavrt.ros2.dds` alone needs the extra ``uavrt[ros2]``; messages, bytes and type hashes do not.
"""

from uavrt.ros2.cdr import decode, encode
from uavrt.ros2.graph import NODES, TOPICS, RosTopic
from uavrt.ros2.interface import definition, full_definition, full_name, type_hash

__all__ = [
    "NODES",
    "TOPICS",
    "RosTopic",
    "decode",
    "definition",
    "encode",
    "full_definition",
    "full_name",
    "type_hash",
]
