"""Queue received ROS 2 messages for the gateway, with a limit for each topic; no I/O.

One thread adds messages and another removes them. Because each topic has its own limit, a flood
of messages on one topic does not delay another. Excess messages are dropped and counted.
"""

from collections import deque
from collections.abc import Callable, Collection
from typing import Generic, TypeVar

from uavrt.link.allowance import Allowance
from uavrt.link.ros2.graph import RosTopic
from uavrt.link.ros2.ros_senders import Arrival

BYTES_OF_ONE = 256
"""Size up to which a ROS 2 message counts as one message [bytes], since decoding time grows
with size. A tag has 76 bytes, a pulse 160, and 32 parameters set at once 4 kB. A message that
alone exceeds its topic's `burst` is dropped without decoding."""
GATEWAYS_NAMED = 20
"""Largest number of other drones' ROS 2 gateways that are counted separately."""


class Inbox:
    """Queues received messages, commands before pulses; drops those on `closed` topics."""

    def __init__(self, now_ns: Callable[[], int], closed: Collection[str] = ()) -> None:
        self._now_ns = now_ns
        self.closed = frozenset(closed)
        self._commands: deque[Arrival] = deque()
        self._data: deque[Arrival] = deque()
        self._allowed: dict[str, Allowance] = {}
        self._dropped: dict[str, int] = {}
        self.of_gateways = 0
        """Number of messages from other drones' ROS 2 gateways, which are ignored."""
        self.gateways: set[str] = set()
        """Keys of other gateways' participants that have sent messages."""

    def put(self, arrival: Arrival) -> None:
        """Queue a message, or drop it and count it as dropped."""
        topic = arrival.topic
        if arrival.sender.gateway:
            self.of_gateways += 1
            if len(self.gateways) < GATEWAYS_NAMED:
                self.gateways.add(arrival.sender.key)
        elif not self._takes(topic, len(arrival.cdr)):
            self.drop(topic)
        else:
            (self._commands if topic.commands else self._data).append(arrival)

    def _takes(self, topic: RosTopic, size: int) -> bool:
        if topic.name in self.closed:
            return False
        if topic.name not in self._allowed:
            self._allowed[topic.name] = Allowance(burst=topic.burst, per_s=topic.per_s)
        cost = max(1, -(-size // BYTES_OF_ONE))
        return self._allowed[topic.name].take(self._now_ns(), cost)

    def drop(self, topic: RosTopic) -> None:
        """Count a message that was sent on a topic but did not reach this queue."""
        self._dropped[topic.name] = self._dropped.get(topic.name, 0) + 1

    @property
    def dropped(self) -> dict[str, int]:
        """Number of dropped messages by topic; topics without drops are left out."""
        return self._dropped.copy()

    def take(self) -> list[Arrival]:
        """Remove and return the waiting messages; the topics' limits bound their number."""
        return [
            waiting.popleft()
            for waiting in (self._commands, self._data)
            for _ in range(len(waiting))
        ]


T = TypeVar("T")


class SendingOrder(Generic[T]):
    """Sorts the messages of several topic readers by the time at which they were sent.

    Readers are emptied one after the other in passes. A message that was sent before those of
    one pass is read in the next pass at the latest, so the messages of a pass are returned
    after the next pass.
    """

    def __init__(self, sent: Callable[[T], tuple[int, ...]]) -> None:
        self._sent = sent
        self._waiting: list[T] = []

    def __bool__(self) -> bool:
        """True if messages wait for the next pass over the readers."""
        return bool(self._waiting)

    def add_pass(self, found: list[T]) -> list[T]:
        """Add the messages of one pass; return those that no later message can precede."""
        last = max(map(self._sent, self._waiting), default=())
        both = sorted(self._waiting + found, key=self._sent)
        ready = [one for one in both if self._sent(one) <= last]
        self._waiting = both[len(ready) :]
        return ready
