"""Who sent a message: a gateway like ours, or somebody who may command. Pure.

A gateway shows what its own ground station asks on the very topics that other gateways obey, so
an order counts only if its participant is known and is no gateway. One is known by its mark (in
the participant's user data, which DDS tells before anything else of it), or, without one, by
what it publishes: earlier releases, the original's `uavrt_connection` and a recording that is
played all publish ``pulse_pose`` beside the orders.

The mark keeps honest systems apart. Whoever wants to deceive leaves it out: against them there
is only the network itself (docs/how-to/ros2.md).
"""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Generic, TypeVar

from uavrt.ros2.graph import RosTopic

GATEWAY_MARK = b"uavrt=gateway;"
DETECTOR_MARK = b"uavrt=detector;"
"""In a participant's user data, beside ROS 2's own ``enclave=/;``."""
SYSTEM_TOPIC = "pulse_pose"
"""Only who has a drone of his own publishes that."""
REMEMBERED = 4096
"""Participants and writers; more, from a network gone wild, push out the oldest."""

K = TypeVar("K")
V = TypeVar("V")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sender:
    """The participant that a message came from."""

    key: str = ""
    """Its identifier; empty if it is not known."""
    gateway: bool = False
    """It speaks for another drone (or for a recording of one)."""


UNKNOWN = Sender()


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """A message as it came."""

    topic: RosTopic
    cdr: bytes
    sent_ns: int = 0
    """When it was sent, by its sender's clock [ns, UTC]."""
    sender: Sender = UNKNOWN


class Senders:
    """What is known about publishers, present or just gone."""

    def __init__(self) -> None:
        self._marked: _Newest[str, bool] = _Newest()
        self._systems: _Newest[str, bool] = _Newest()
        self._writers: _Newest[int, str] = _Newest()

    def add_participant(self, key: str, user_data: bytes) -> None:
        """Note a participant."""
        self._marked[key] = GATEWAY_MARK in user_data

    def add_writer(self, handle: int, participant: str, topic: str) -> None:
        """Note that a participant publishes a topic (its name as DDS has it)."""
        self._writers[handle] = participant
        if topic.rpartition("/")[2] == SYSTEM_TOPIC:
            self._systems[participant] = True

    def of(self, handle: int) -> Sender:
        """Get who has the writer of this handle."""
        key = self._writers.get(handle)
        if key is None or key not in self._marked:
            return UNKNOWN
        return Sender(key=key, gateway=self._marked[key] or key in self._systems)


class _Newest(OrderedDict[K, V], Generic[K, V]):
    """A dictionary of the newest `REMEMBERED`."""

    def __setitem__(self, key: K, value: V) -> None:
        super().__setitem__(key, value)
        self.move_to_end(key)
        if len(self) > REMEMBERED:
            self.popitem(last=False)
