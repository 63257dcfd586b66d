"""A gateway without a network: what it publishes is kept, what is put in reaches it."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

import made
from pulses import pulse_at

from uavrt.config.settings import Ros2Settings, Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import ProcessStatus, Tag
from uavrt.link.ros2.gateway import Gateway
from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.inbox import Inbox
from uavrt.link.ros2.ros_senders import Arrival, Sender
from uavrt.link.ros2.types.cdr import encode
from uavrt.link.ros2.types.ros_messages import DiagnosticArray, DiagnosticStatus, RosMessage

S = 10**9
OPERATOR = Sender(key="operator")
NEIGHBOUR = Sender(key="neighbour", gateway=True)
STARTED = DiagnosticArray(status=(DiagnosticStatus(message="start"),))
TAG = made.tag()
PULSE = pulse_at(
    1_700_000_000 * S,
    frequency_hz=148_710_000.0,
    noise_psd=0.0,
    detection_status="detected",
    confirmed=False,
)
FLIGHT = made.flight_info("/flights/one", (TAG,), start_time_ns=(1_700_000_000 - 60) * S)


class Line:
    """A network of one: what is published is kept, what is put in is heard."""

    def __init__(self, now_ns: Callable[[], int], closed: Collection[str]) -> None:
        self.said: list[tuple[str, RosMessage]] = []
        self.inbox = Inbox(now_ns, closed)

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        self.said.append((topic, message))

    def reply(self, message: RosMessage) -> None:
        raise AssertionError("no service was asked")

    def show_detectors(self, nodes: Collection[str]) -> None:
        raise AssertionError("a node for each tag was not asked for")

    def hear(
        self, topic: str, message: RosMessage, sender: Sender = OPERATOR, sent_ns: int = 0
    ) -> None:
        self.inbox.put(
            Arrival(topic=TOPICS[topic], cdr=encode(message), sender=sender, sent_ns=sent_ns)
        )

    def on(self, topic: str) -> list[Any]:
        return [message for name, message in self.said if name == topic]


class Bench:
    """A gateway, its network, its supervisor, and a clock that stands until it is moved."""

    def __init__(self, **ros2: Any) -> None:
        self.sent: list[tuple[str, Any]] = []
        self.now_ns = 1_700_000_000 * S
        closed = () if ros2.get("accept_pulses") else ("pulse",)
        self.line = Line(lambda: self.now_ns, closed)
        self.gateway = Gateway(
            self.line,
            Settings(ros2=Ros2Settings(enabled=True, **ros2)),
            lambda topic, record: self.sent.append((topic, record)),
            lambda: self.now_ns,
        )

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 20)):
            self.gateway.tick()
            self.now_ns += 50_000_000

    def hear(self, topic: str, message: RosMessage, sender: Sender = OPERATOR) -> None:
        """Hear a message and act on it."""
        self.line.hear(topic, message, sender)
        self.run(0.1)

    def status(self, state: SystemState, *processes: ProcessStatus) -> None:
        told = made.system_status(
            self.now_ns,
            state=state,
            center_frequency_hz=148.7e6,
            tags=(TAG,),
            processes=processes,
        )
        self.gateway.receive(told)

    def commands(self) -> list[str]:
        return [record.name for topic, record in self.sent if topic == "command"]


def tags(count: int) -> list[Tag]:
    return [replace(TAG, tag_id=2 * number) for number in range(1, count + 1)]


def started_with(bench: Bench) -> int | None:
    (start,) = (
        r for topic, r in bench.sent if topic == "command" and r.name == "start_detection"
    )
    count: int | None = start.tag_count
    return count
