"""What the gateway says and hears, without a network."""

from dataclasses import replace
from typing import Any

from pulses import pulse_at

from uavrt.config.settings import Ros2Settings, Settings
from uavrt.messages import (
    CommandReply,
    ProcessStatus,
    SystemState,
    SystemStatus,
    Tag,
)
from uavrt.ros2 import TOPICS, RosTopic, encode
from uavrt.ros2.convert import pulse_to_ros, tag_to_ros
from uavrt.ros2.gateway import Gateway
from uavrt.ros2.messages import DiagnosticArray, Flag, RosMessage

S = 10**9
TAG = Tag(tag_id=2, frequency_hz=148.71e6, pulse_width_s=0.02, pulse_intervals_s=(1.254,))
PULSE = pulse_at(
    1_700_000_000 * S,
    frequency_hz=148_710_000.0,
    noise_psd=0.0,
    detection_status="detected",
    confirmed=False,
)


class Line:
    """A network of one: what is published is kept, what is put in is heard."""

    def __init__(self) -> None:
        self.said: list[tuple[str, RosMessage]] = []
        self.waiting: list[tuple[RosTopic, bytes]] = []

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        self.said.append((topic, message))

    def take(self, limit: int) -> list[tuple[RosTopic, bytes]]:
        taken, self.waiting = self.waiting[:limit], self.waiting[limit:]
        return taken

    def hear(self, topic: str, message: RosMessage) -> None:
        self.waiting.append((TOPICS[topic], encode(message)))

    def on(self, topic: str) -> list[Any]:
        return [message for name, message in self.said if name == topic]


class Bench:
    """A gateway, its network, its supervisor, and a clock that stands until it is moved."""

    def __init__(self, **ros2: Any) -> None:
        self.line = Line()
        self.sent: list[tuple[str, Any]] = []
        self.now_ns = 1_700_000_000 * S
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

    def status(self, state: SystemState, *processes: ProcessStatus) -> None:
        self.gateway.take(
            SystemStatus(
                time_ns=self.now_ns,
                state=state,
                flight_directory=None,
                center_frequency_hz=148.7e6,
                tags=(TAG,),
                processes=processes,
            )
        )

    def commands(self) -> list[str]:
        return [record.name for topic, record in self.sent if topic == "command"]


def worker(name: str = "detector-1") -> ProcessStatus:
    return ProcessStatus(
        process=name,
        running=True,
        pid=1,
        status="detecting",
        ok=True,
        restarts=0,
        cpu_s=0.0,
        memory_mb=0.0,
    )


def test_status_is_told_twice_a_second_and_a_beat_once() -> None:
    bench = Bench()
    for _ in range(10):
        bench.status(SystemState.DETECTING, worker())
        bench.run(1.0)
    assert 19 <= len(bench.line.on("status_detector_subprocess")) <= 21
    assert 9 <= len(bench.line.on("pulse")) <= 10


def test_nothing_to_run_is_an_empty_status_and_no_beat() -> None:
    bench = Bench()
    bench.status(SystemState.IDLE)
    bench.run(2.0)
    arrays = bench.line.on("status_channelizer_subprocess")
    assert len(arrays) == 4
    assert all(isinstance(a, DiagnosticArray) and a.status == () for a in arrays)
    assert bench.line.on("pulse") == []


def test_a_supervisor_that_falls_silent_makes_every_status_stale_and_stops_the_beats() -> None:
    bench = Bench()
    bench.status(SystemState.DETECTING, worker(), worker("receiver"))
    bench.run(10.0)
    for component in ("airspy_csdr_netcat", "channelizer", "detector"):
        levels = [a.status[0].level for a in bench.line.on(f"status_{component}_subprocess")]
        assert levels[0] == 0
        assert levels[-1] == 3
    assert len(bench.line.on("pulse")) <= 4


def test_a_refused_tag_begins_the_next_upload_anew() -> None:
    bench = Bench()
    bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.run(0.1)
    assert bench.commands() == ["start_tags", "add_tag"]
    start = bench.sent[0][1]
    bench.gateway.take(
        CommandReply(
            request_id=start.request_id,
            name="start_tags",
            accepted=False,
            message="detecting: send stop first",
        )
    )
    assert "start_tags refused: detecting" in bench.line.on("rosout")[-1].msg
    bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.run(0.1)
    assert bench.commands()[2:] == ["start_tags", "add_tag"]


def test_a_tag_joins_the_upload_that_the_ground_has_open() -> None:
    bench = Bench()
    bench.status(SystemState.RECEIVING_TAGS)
    bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.line.hear("release_tag_information", Flag(data=True))
    bench.run(0.1)
    assert bench.commands() == ["add_tag", "end_tags"]


def test_a_hundred_tags_are_taken_at_once_and_a_flood_is_not() -> None:
    bench = Bench()
    for _ in range(100):
        bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.run(1.0)
    assert bench.commands().count("add_tag") == 100
    for _ in range(5000):
        bench.line.hear("release_tag_information", Flag(data=True))
    bench.run(12.0)
    assert len(bench.commands()) <= 400 + 10 * 13
    assert len(bench.line.on("rosout")) <= 50 + 13
    assert bench.gateway.counters["ros2_messages_refused"] > 4000


def test_pulses_of_other_computers_are_taken_once_and_not_sent_back() -> None:
    bench = Bench(accept_pulses=True)
    for _ in range(3):
        bench.line.hear("pulse", pulse_to_ros(PULSE, "/elsewhere"))
    bench.run(0.1)
    ((topic, record),) = bench.sent
    assert topic == "pulse"
    assert (record.tag_id, record.start_time_ns) == (2, PULSE.start_time_ns)
    bench.gateway.take(record)
    assert bench.line.on("pulse") == []


def test_pulses_of_other_computers_are_not_taken_unless_wanted() -> None:
    bench = Bench()
    bench.line.hear("pulse", pulse_to_ros(PULSE, "/elsewhere"))
    bench.run(0.1)
    assert bench.sent == []


def test_a_flood_of_pulses_is_taken_no_faster_than_a_hundred_tags_beep() -> None:
    bench = Bench(accept_pulses=True)
    for number in range(4000):
        later = PULSE.start_time_ns + number * S
        pulse = replace(PULSE, start_time_ns=later, end_time_ns=later + 20_000_000)
        bench.line.hear("pulse", pulse_to_ros(pulse, ""))
    bench.run(10.0)
    assert len(bench.sent) <= 1000 + 100 * 10
