"""Interface of the gateway to ROS 2, which `uavrt.link.ros2.network.dds` implements."""

from collections.abc import Collection
from typing import Protocol

from uavrt.link.ros2.inbox import Inbox
from uavrt.link.ros2.types.parameter_messages import ServiceMessage
from uavrt.link.ros2.types.ros_messages import RosMessage


class Bus(Protocol):
    """Publishes ROS 2 messages, and queues received messages for the gateway."""

    inbox: Inbox

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message on its topic."""

    def show_detectors(self, nodes: Collection[str]) -> None:
        """Show a publishing node for the detector of each given tag, and for no other."""

    def reply(self, message: ServiceMessage) -> None:
        """Send the reply of a service."""
