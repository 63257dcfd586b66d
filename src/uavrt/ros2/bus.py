"""The ROS 2 side as the gateway needs it: `uavrt.ros2.dds.Participant`, or a test's."""

from collections.abc import Collection
from typing import Protocol

from uavrt.ros2.messages import RosMessage
from uavrt.ros2.parameter_messages import ServiceMessage
from uavrt.ros2.senders import Arrival


class Bus(Protocol):
    """Sends messages and holds those that have arrived."""

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message."""

    def show_detectors(self, nodes: Collection[str]) -> None:
        """Have a node that publishes pulses for each of these, and for no others."""

    def reply(self, message: ServiceMessage) -> None:
        """Send the reply of a service."""

    def take(self, limit: int) -> list[Arrival]:
        """Get messages that have arrived, in the order in which they were sent."""

    def lost(self, topic: str) -> int:
        """Count the messages of a topic that were sent and cannot be got any more."""
