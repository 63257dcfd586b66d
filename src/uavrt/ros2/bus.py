"""The ROS 2 side as the gateway needs it: `uavrt.ros2.dds.Participant`, or a test's."""

from typing import Protocol

from uavrt.ros2.graph import RosTopic
from uavrt.ros2.messages import RosMessage


class Bus(Protocol):
    """Sends messages and holds those that have arrived."""

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message."""

    def take(self, limit: int) -> list[tuple[RosTopic, bytes]]:
        """Get messages that have arrived, as their topic and CDR bytes."""
