"""Request ids, replayed acknowledgements, upload sets and progress: the numbered versions."""

from dataclasses import dataclass, field
from typing import Any

import made
import pytest
from some import some, typed

from uavrt.core.commands import CommandId, Generation, SystemState
from uavrt.core.errors import ConfigError
from uavrt.core.messages import Command, Operation, PulsePose
from uavrt.ground.link.requests.command_payloads import CommandEncoder
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.generations.codec import decode
from uavrt.link.tunnel.generations.g0 import FAILURE, SUCCESS
from uavrt.link.tunnel.generations.g1 import AckG1, PulseG1
from uavrt.link.tunnel.generations.g2 import (
    AckG2,
    BareG2,
    DetectorHeartbeat,
    HeartbeatG2,
    OperationProgress,
    PulseG2,
    PulseG2v1,
    TagG2,
    UploadG2,
)
from uavrt.link.tunnel.requests import KEPT, KEPT_S
from uavrt.link.tunnel.tunnel_records import ack_to_wire, pulse_to_wire

GROUND = (255, 190)


@dataclass
class Drone:
    """An exchange with a supervisor that does what it is asked."""

    exchange: Exchange
    commands: list[Command] = field(default_factory=list)
    now_s: float = 1000.0
    refuse: str = ""

    def hear(self, payload: bytes, requester: tuple[int, int] = GROUND) -> AckG2 | None:
        result = self.exchange.receive(payload, requester)
        if isinstance(result, Command):
            self.commands.append(result)
            result = self.exchange.reply(
                made.reply(
                    result, message=self.refuse or "flight_log_x", accepted=not self.refuse
                )
            )
        if result is None:
            return None
        assert result.requester == requester
        ack = typed(AckG2, decode(result.payload, "G2"))
        return ack


def drone(**settings: Any) -> Drone:
    made = Drone.__new__(Drone)
    settings = {"generation": "G2", "experimental": True, **settings}
    Drone.__init__(made, Exchange(**settings, clock_s=lambda: made.now_s))
    return made


TAGS = [made.tag(number, 148_710_000.0, 1.3) for number in (2, 4, 6)]


def stop(request_id: int) -> bytes:
    return BareG2(command=CommandId.STOP_DETECTION, request_id=request_id).encode()


def test_a_repeated_request_gets_the_same_acknowledgement_and_is_done_once() -> None:
    for refusal in ("", "detecting: send stop first"):
        one = drone()
        one.refuse = refusal
        first = some(one.hear(stop(77)))
        assert (first.request_id, first.result) == (77, 0 if refusal else 1)
        one.refuse = "something else by now"
        assert one.hear(stop(77)) == first
        assert len(one.commands) == 1
        assert one.exchange.counters["acknowledgements_replayed"] == 1


def test_a_request_that_is_still_worked_on_gets_no_second_answer() -> None:
    exchange = Exchange("G2", experimental=True)
    assert isinstance(exchange.receive(stop(5), GROUND), Command)
    assert exchange.receive(stop(5), GROUND) is None


def test_a_request_id_used_for_something_else_is_refused() -> None:
    one = drone()
    one.hear(stop(5))
    other = BareG2(command=CommandId.SAVE_LOGS, request_id=5).encode()
    answer = some(one.hear(other))
    assert answer.result == FAILURE
    assert "request_id reuse" in answer.message
    again = some(one.hear(stop(5)))
    assert again.result == SUCCESS  # the first one's is still kept
    assert one.hear(other, (254, 190)) is not None  # another station's ids are its own
    assert [command.name for command in one.commands] == ["stop_detection", "save_logs"]


def test_the_last_sixteen_requests_are_kept_for_two_minutes_and_id_0_never() -> None:
    one = drone()
    for number in range(1, KEPT + 2):
        one.hear(stop(number))
    one.hear(stop(2))
    assert len(one.commands) == KEPT + 1
    one.hear(stop(1))
    assert len(one.commands) == KEPT + 2
    one.now_s += KEPT_S + 1
    one.hear(stop(5))
    one.hear(stop(0))
    one.hear(stop(0))
    assert len(one.commands) == KEPT + 5


def test_an_upload_is_complete_only_with_every_tag() -> None:
    one = drone()
    first, *inside, last = CommandEncoder("G2").upload(TAGS)
    assert one.hear(first).result == SUCCESS  # type: ignore[union-attr]
    assert one.hear(inside[0]).result == SUCCESS  # type: ignore[union-attr]
    incomplete = some(one.hear(last))
    assert incomplete.message == "incomplete: missing 1,2"
    one.refuse = "tag 4 was already sent with other values: send START_TAGS to begin again"
    assert one.hear(inside[1]).result == FAILURE  # type: ignore[union-attr]
    one.refuse = ""
    assert one.hear(inside[2]).result == SUCCESS  # type: ignore[union-attr]
    assert one.hear(inside[1]).result == FAILURE  # type: ignore[union-attr]  # replayed
    retry = typed(TagG2, decode(inside[1]))
    fresh = TagG2(request_id=12345, upload_id=retry.upload_id, tag_index=1, tag=retry.tag)
    assert one.hear(fresh.encode()).result == SUCCESS  # type: ignore[union-attr]
    end = typed(UploadG2, decode(last))
    ended = UploadG2(
        command=CommandId.END_TAGS, request_id=12346, upload_id=end.upload_id, tag_count=3
    )
    assert one.hear(ended.encode()).result == SUCCESS  # type: ignore[union-attr]
    assert [c.tag.tag_id for c in one.commands if c.tag is not None] == [2, 4, 6, 4]
    assert one.commands[-1].name == "end_tags"


def test_tags_of_another_upload_and_counts_that_differ_are_refused_by_name() -> None:
    one = drone()
    first, tag, _ = CommandEncoder("G2").upload(TAGS[:1])
    no_upload = some(one.hear(tag))
    assert "no upload is open" in no_upload.message
    one.hear(first)
    upload_id = int.from_bytes(first[8:12], "little")

    def frame(command: CommandId, request_id: int, upload: int, count: int) -> str:
        message = UploadG2(
            command=command, request_id=request_id, upload_id=upload, tag_count=count
        )
        answer = some(one.hear(message.encode()))
        assert answer.result == FAILURE
        return answer.message

    assert "stale upload_id" in frame(CommandId.END_TAGS, 1, upload_id + 1, 1)
    assert "tag_count mismatch" in frame(CommandId.END_TAGS, 2, upload_id, 2)
    assert "tag_count is 0" in frame(CommandId.START_TAGS, 3, 9, 0)
    wire = typed(TagG2, decode(tag))
    for upload, index, word in ((upload_id + 1, 0, "stale"), (upload_id, 1, "beyond")):
        message = TagG2(request_id=50 + index, upload_id=upload, tag_index=index, tag=wire.tag)
        answer = some(one.hear(message.encode()))
        assert word in answer.message


def test_progress_goes_to_who_asked_until_it_is_complete() -> None:
    one = drone()
    step = Operation(name="save_logs", state="running", step=1, step_count=4, message="one")
    assert one.exchange.operations.progress(step) is None  # before the supervisor's reply
    save = BareG2(command=CommandId.SAVE_LOGS, request_id=9).encode()
    one.hear(save, (245, 190))
    (again,) = one.exchange.operations.again()
    assert again == one.exchange.operations.progress(step)
    assert again.requester == (245, 190)
    read = decode(again.payload, "G2")
    assert read == OperationProgress(
        operation=12, request_id=9, state=0, step=1, step_count=4, message="one"
    )
    last = some(
        one.exchange.operations.progress(
            Operation(name="save_logs", state="failed", message="full")
        )
    )
    ended = typed(OperationProgress, decode(last.payload, "G2"))
    assert (ended.state, ended.message) == (2, "full")
    assert one.exchange.operations.again() == []


def test_version_4_has_no_progress_and_tells_its_number() -> None:
    one = drone(version=4)
    one.hear(BareG2(command=CommandId.SAVE_LOGS, request_id=9).encode())
    running = Operation(name="save_logs", state="running")
    assert one.exchange.operations.progress(running) is None
    beat = some(one.exchange.heartbeat(SystemState.HAS_TAGS, None))
    read = typed(HeartbeatG2, decode(beat, "G2"))
    assert (read.protocol_version, read.status) == (4, 2)
    alive = some(one.exchange.detector_heartbeat(2, 10**18))
    assert isinstance(decode(alive, "G2"), PulseG2)
    assert isinstance(
        decode(drone().exchange.detector_heartbeat(2, 0) or b"", "G2"), DetectorHeartbeat
    )


def test_inferred_layouts_are_used_only_where_the_settings_say_so() -> None:
    with pytest.raises(ConfigError, match="tunnel_experimental"):
        Exchange("G2")
    one = drone(generation="auto", experimental=False)
    first, tag, last = CommandEncoder("G2").upload(TAGS[:1])
    assert one.hear(first).result == SUCCESS  # type: ignore[union-attr]
    refused = some(one.hear(tag))
    assert "experimental command" in refused.message
    answered = one.hear(last)
    assert answered.message == "incomplete: missing 0"  # type: ignore[union-attr]
    assert one.exchange.generation == "G1"  # pulses are not sent in it


def test_version_1_speaks_as_g1_with_a_number_and_a_longer_pulse() -> None:
    exchange = Exchange("G2v1")
    beat = some(exchange.heartbeat(SystemState.DETECTING, 40.0))
    assert len(beat) == 16
    report = made.search_report(2, 10**18)
    payload = some(exchange.search_report(report))
    read = typed(PulseG2v1, decode(payload, "G2v1"))
    assert (read.collection_id, read.pulse.detection_status) == (0, 3)
    start, tag, _ = CommandEncoder("G2v1").upload(TAGS[:1])
    assert isinstance(exchange.receive(start, GROUND), Command)
    assert isinstance(exchange.receive(tag, GROUND), Command)
    refusal = typed(Answer, exchange.receive(tag[:50], GROUND))
    assert isinstance(decode(refusal.payload, "G2v1"), AckG1)


def test_a_payload_of_a_wrong_length_is_refused_under_its_request_id() -> None:
    answer = some(drone().hear(stop(123) + b"\0"))
    assert (answer.request_id, answer.result) == (123, FAILURE)
    assert "9 bytes" in answer.message


@pytest.mark.parametrize(("generation", "room"), [("G1", 115), ("G2", 107)])
def test_of_a_long_directory_the_end_is_told(generation: Generation, room: int) -> None:
    path = "/home/pi/" + "ü" * 60 + "/flights/flight_log_2026-11-21_22-05-04"
    payload = ack_to_wire(5, True, path, generation).encode()
    ack = decode(payload, generation)
    assert isinstance(ack, AckG1 | AckG2)
    assert ack.message.startswith("…")
    assert path.endswith(ack.message[1:])
    assert room - 1 <= len(ack.message.encode()) <= room
    short = decode(ack_to_wire(5, True, "/x", generation).encode(), generation)
    assert isinstance(short, AckG1 | AckG2)
    assert short.message == "/x"


def test_a_pulse_survives_every_generation() -> None:
    pulse = made.pulse(1_700_206_353_000_000_000, group_sequence=3)
    generations: tuple[Generation, ...] = ("G1", "G2v1", "G2")
    inner = []
    for generation in generations:
        payload = pulse_to_wire(PulsePose(pulse=pulse, pose=None), generation).encode()
        read = decode(payload, generation)
        assert isinstance(read, PulseG1 | PulseG2v1 | PulseG2)
        inner.append((read if isinstance(read, PulseG1) else read.pulse).encode())
    assert len(set(inner)) == 1
