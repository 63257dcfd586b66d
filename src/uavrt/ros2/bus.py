"""The ROS 2 side as the gateway needs it: `uavrt.ros2.dds.Participant`, or a test's."""

from collections.abc import Collection
from typing import Protocol

from uavrt.ros2.inbox import Inbox
from uavrt.ros2.messages import RosMessage
from uavrt.ros2.parameter_messages import ServiceMessage


class Bus(Protocol):
    """Sends messages and holds those that have arrived."""

    inbox: Inbox

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message."""

    def show_detectors(self, nodes: Collection[str]) -> None:
        """Have a node that publishes pulses for each of these, and for no others."""

    def reply(self, message: ServiceMessage) -> None:
        """Send the reply of a service."""
