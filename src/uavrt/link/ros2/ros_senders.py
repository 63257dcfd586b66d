"""Identify senders of messages: other gateways, and authorised commanders; no I/O.

A gateway publishes its own ground station's commands on the topics that other gateways obey. So
a command counts only if its participant is known and is not a gateway. Gateways have a mark in
the participant's user data, which DDS sends first. Those without it are recognised by their
topics ``pulse_pose`` and commands: earlier releases, the original's `uavrt_connection` and a
recording that is played.

The mark separates honest systems. An attacker leaves it out; only the network protects against
that (docs/how-to/ros2.md).
"""

from dataclasses import dataclass

from uavrt.core.newest import Newest
from uavrt.link.ros2.graph import RosTopic

GATEWAY_MARK = b"uavrt=gateway;"
DETECTOR_MARK = b"uavrt=detector;"
"""Text in a DDS participant's user data that marks a detector, next to ROS 2's own
``enclave=/;``."""
SYSTEM_TOPIC = "pulse_pose"
"""Topic that only a drone's ROS 2 gateway publishes, which identifies gateways."""
REMEMBERED = 4096
"""Largest number of remembered participants and writers; newer ones replace the oldest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sender:
    """A DDS participant that has sent a ROS 2 message."""

    key: str = ""
    """Identifier of the participant; empty if unknown."""
    gateway: bool = False
    """True if the participant is the gateway of another drone, or a recording of one."""


UNKNOWN = Sender()


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """A received message with its sender and times."""

    topic: RosTopic
    cdr: bytes
    sent_ns: int = 0
    """Time of sending, by the sender's clock [ns, UTC]."""
    sender: Sender = UNKNOWN


class Senders:
    """Table of the DDS publishers on the network, also of those that have just left."""

    def __init__(self) -> None:
        self._marked: Newest[str, bool] = Newest(REMEMBERED)
        self._systems: Newest[str, bool] = Newest(REMEMBERED)
        self._writers: Newest[int, str] = Newest(REMEMBERED)

    def add_participant(self, key: str, user_data: bytes) -> None:
        """Register a participant by its user data."""
        self._marked[key] = GATEWAY_MARK in user_data

    def add_writer(self, handle: int, participant: str, topic: str) -> None:
        """Register that a participant publishes a topic, by its DDS name."""
        self._writers[handle] = participant
        if topic.rpartition("/")[2] == SYSTEM_TOPIC:
            self._systems[participant] = True

    def of(self, handle: int) -> Sender:
        """Return the participant that owns the writer with this handle."""
        key = self._writers.get(handle)
        if key is None or key not in self._marked:
            return UNKNOWN
        return Sender(key=key, gateway=self._marked[key] or key in self._systems)
