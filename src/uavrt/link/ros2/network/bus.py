"""Interface of the gateway to ROS 2, implemented by `uavrt.link.ros2.network.dds`."""

from collections.abc import Collection
from typing import Protocol

from uavrt.link.ros2.inbox import Inbox
from uavrt.link.ros2.types.parameter_messages import ServiceMessage
from uavrt.link.ros2.types.ros_messages import RosMessage


class Bus(Protocol):
    """Sends ROS 2 messages and keeps received ones for the gateway."""

    inbox: Inbox

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message on its topic."""

    def show_detectors(self, nodes: Collection[str]) -> None:
        """Keep one publishing node for each given tag's detector, and no others."""

    def reply(self, message: ServiceMessage) -> None:
        """Send the reply of a service."""
