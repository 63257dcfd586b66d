"""The drone's side of the tunnel's conversation, without I/O.

Payloads of ground stations become commands for the supervisor; its replies become
acknowledgements to the sender; pulses and states become payloads in the ground's generation.
"""

from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from uavrt.clock import monotonic_s
from uavrt.commands import (
    COMMAND_OF_NUMBER,
    COMMANDS,
    CommandId,
    CommandName,
    Generation,
    SystemState,
)
from uavrt.errors import ConfigError, TunnelError
from uavrt.messages import Command, CommandReply, Operation, PulsePose, SearchReport
from uavrt.tunnel import g2
from uavrt.tunnel.codec import TunnelMessage, acked_command_of, decode, generation_of
from uavrt.tunnel.coded_tag import CodedTag
from uavrt.tunnel.convert import (
    ack_to_wire,
    detector_heartbeat,
    heartbeat_to_wire,
    in_generation,
    pulse_to_wire,
    search_report_to_wire,
    tag_from_wire,
)
from uavrt.tunnel.g0 import HeaderMessage, TagG0
from uavrt.tunnel.g1 import TagG1
from uavrt.tunnel.requests import RequestCache, TagUpload, open_upload
from uavrt.tunnel.wire import Asking

Asker = tuple[int, int]
"""System and component id of a ground station."""

PENDING = 64
"""Most commands waiting for the supervisor's reply; it answers in milliseconds."""
PROGRESS_VERSION, ALIVE_VERSION = 5, 6
"""Versions that brought OPERATION_PROGRESS and DETECTOR_HEARTBEAT."""
STATES = {"running": g2.RUNNING, "complete": g2.COMPLETE, "failed": g2.FAILED}


@dataclass(frozen=True, slots=True)
class Answer:
    """A payload for the station that asked."""

    payload: bytes
    asker: Asker


@dataclass(frozen=True, slots=True, kw_only=True)
class _Question:
    """Sender, command and generation of a question."""

    asker: Asker
    number: int
    generation: Generation
    request_id: int = 0
    tag_index: int | None = None
    spoken: Generation | None = None
    """Generation of the sender's messages, if they show it."""
    upload: TagUpload | None = None
    """The upload that it opens, if it is accepted."""


class Operations:
    """Progress of the operations that stations began; `version` is the one sent with G2."""

    def __init__(self, version: int) -> None:
        self._version = version
        self._questions: dict[CommandName, _Question] = {}
        self._last: dict[CommandName, Operation] = {}

    def begun(self, name: CommandName, question: _Question) -> None:
        """Note who gets the steps of an operation."""
        self._questions[name] = question

    def progress(self, operation: Operation) -> Answer | None:
        """Return a step of an operation to its sender, if the generation has it."""
        self._last[operation.name] = operation
        answer = self._step(operation)
        if operation.state != "running":
            del self._last[operation.name]
            self._questions.pop(operation.name, None)
        return answer

    def again(self) -> list[Answer]:
        """Get the last step of all that is running; to be sent once a second."""
        steps = (self._step(operation) for operation in self._last.values())
        return [step for step in steps if step is not None]

    def _step(self, operation: Operation) -> Answer | None:
        question = self._questions.get(operation.name)
        number = COMMANDS[operation.name].number
        if question is None or number is None or self._version < PROGRESS_VERSION:
            return None
        step = g2.OperationProgress(
            operation=number,
            request_id=question.request_id,
            state=STATES[operation.state],
            step=operation.step,
            step_count=operation.step_count,
            message=operation.message,
        )
        return Answer(step.encode(), question.asker)


class Exchange:
    """Keeps open questions, and the generation of the ground.

    `generation`: of what we send. "auto" answers each in the generation of its own message, and
    sends the pulses in the generation of the last upload of tags, G1 before any. The numbered
    versions must be set, because their ground stations send nothing before they have received
    their own number. `version`: number sent with G2, 4 to 7. `experimental`: whether inferred
    layouts may be used. Raises `ConfigError`: G2 without `experimental`.
    """

    def __init__(
        self,
        generation: Literal["auto", "G0", "G1", "G2v1", "G2"] = "auto",
        *,
        version: int = 7,
        experimental: bool = False,
        clock_s: Callable[[], float] = monotonic_s,
    ) -> None:
        if generation == "G2" and not experimental:
            raise ConfigError(
                "some layouts of the tunnel's generation G2 were inferred, not seen",
                remedy="Set mavlink.tunnel_experimental = true to use it anyway",
            )
        self._fixed: Generation | None = None if generation == "auto" else generation
        self._version, self._experimental = version, experimental
        self._clock_s = clock_s
        self._heard: Generation = "G1"
        self._pending: OrderedDict[int, _Question] = OrderedDict()
        self._next_id = 1
        self._requests = RequestCache()
        self._upload: TagUpload | None = None
        self.operations = Operations(version)
        self.counters: Counter[str] = Counter()

    @property
    def generation(self) -> Generation:
        """Generation of the pulses sent."""
        return self._fixed or self._heard

    def refuse(self, payload: bytes, reason: str, asker: Asker) -> Answer | None:
        """Refuse a payload unread; None when it is no command."""
        self.counters["commands_not_allowed"] += 1
        return self._refusal(payload, reason, asker)

    def receive(
        self, payload: bytes, asker: Asker, *, coded_tag: bool = False
    ) -> Command | Answer | None:
        """Handle a payload of a ground station.

        Returns a command for the supervisor, or the answer to a payload that is none, or None
        if no answer is needed.
        """
        try:
            message = CodedTag.decode(payload) if coded_tag else decode(payload)
            if isinstance(message, g2.Requests):
                return self._request(message, payload, asker)
            if isinstance(message, CodedTag) and message.request_id:
                return self._request(message, payload, asker)
            return self._command(message, asker)
        except TunnelError as error:
            self.counters["payloads_refused"] += 1
            return self._refusal(payload, str(error), asker)

    def reply(self, reply: CommandReply) -> Answer | None:
        """Turn the supervisor's reply into the asker's acknowledgement."""
        question = self._pending.pop(reply.request_id, None)
        if question is None:
            return None
        if reply.accepted:
            # Only now: a refused sender must not change the generation of others.
            self._heard = question.spoken or self._heard
            self._upload = question.upload or self._upload
        if reply.accepted and question.generation == "G2":
            if question.tag_index is not None and self._upload is not None:
                self._upload.indices.add(question.tag_index)
            self.operations.begun(reply.name, question)
        return self._answer(question, reply.accepted, reply.message)

    def pulse(self, pulse_pose: PulsePose) -> bytes:
        """Get the payload of a pulse."""
        return pulse_to_wire(pulse_pose, self.generation).encode()

    def search_report(self, report: SearchReport) -> bytes | None:
        """Get the payload of "searched, nothing found"; None in the thesis's generation."""
        if self.generation == "G0":
            return None
        return in_generation(search_report_to_wire(report), self.generation).encode()

    def detector_heartbeat(self, tag_id: int, time_ns: int) -> bytes | None:
        """Get the payload of a detector's sign of life; None in the thesis's generation."""
        if self.generation == "G0":
            return None
        if self.generation == "G2" and self._version >= ALIVE_VERSION:
            return g2.DetectorHeartbeat(tag_id=tag_id).encode()
        return in_generation(detector_heartbeat(tag_id, time_ns), self.generation).encode()

    def heartbeat(self, state: SystemState, cpu_temperature_c: float | None) -> bytes | None:
        """Get the payload of the 1 Hz heartbeat; None in the thesis's generation."""
        if self.generation == "G0":
            return None
        old = heartbeat_to_wire(state, cpu_temperature_c)
        if self.generation == "G1":
            return old.encode()
        first = self.generation == "G2v1"
        kind = g2.HeartbeatG2v1 if first else g2.HeartbeatG2
        return kind(
            protocol_version=1 if first else self._version,
            system_id=old.system_id,
            status=old.status,
            cpu_temperature_c=old.cpu_temperature_c,
        ).encode()

    def next_request_id(self) -> int:
        """Give a number to a command from outside the tunnel."""
        self._next_id += 1
        return self._next_id - 1

    def _request(
        self, message: g2.Requests | CodedTag, payload: bytes, asker: Asker
    ) -> Command | Answer | None:
        """Handle a command of version 4 or later, once."""
        known = self._requests.repeated(asker, message.request_id, payload, self._clock_s())
        if known is True:
            return None  # its acknowledgement is on its way
        if known is not False:
            self.counters["acknowledgements_replayed"] += 1
            return Answer(known, asker)
        number = acked_command_of(payload)
        assert number is not None
        question = _Question(
            asker=asker, number=number, generation="G2", request_id=message.request_id
        )
        try:
            if isinstance(message, g2.INFERRED) and not self._experimental:
                raise TunnelError(
                    "this layout was never seen: mavlink.tunnel_experimental allows it", payload
                )
            if self._experimental:
                question = replace(question, spoken="G2")
            return self._numbered_command(message, question)
        except TunnelError as error:
            self.counters["payloads_refused"] += 1
            return self._answer(question, False, str(error))

    def _numbered_command(
        self, message: g2.Requests | CodedTag, question: _Question
    ) -> Command | Answer:
        match message:
            case CodedTag():
                self._open_upload(message).check_tag(message, question.asker)
                question = replace(question, tag_index=message.tag_index)
                return replace(self._ask(question, "add_tag"), tag=message.tag)
            case g2.UploadG2(command=CommandId.START_TAGS):
                upload = open_upload(message, question.asker)
                return self._ask(replace(question, upload=upload), "start_tags")
            case g2.UploadG2():
                self._open_upload(message).check_end(message, question.asker)
                return self._ask(question, "end_tags")
            case g2.TagG2(upload_id=0):  # a correction in flight
                return replace(self._ask(question, "add_tag"), tag=tag_from_wire(message.tag))
            case g2.TagG2():
                self._open_upload(message).check_tag(message, question.asker)
                tag = tag_from_wire(message.tag)
                question = replace(question, tag_index=message.tag_index)
                return replace(self._ask(question, "add_tag"), tag=tag)
            case Asking():
                return self._ask_with(question, message)
            case g2.SetLogLevel():
                self.counters["log_levels"] += 1
                return self._answer(question, True, "all levels are recorded")
            case g2.BareG2(command=command):
                return self._ask(question, COMMAND_OF_NUMBER[command].name)

    def _open_upload(self, message: g2.Requests | CodedTag) -> TagUpload:
        if self._upload is None:
            raise TunnelError("no upload is open: send START_TAGS first", message.encode())
        return self._upload

    def _command(
        self, message: TunnelMessage | CodedTag, asker: Asker
    ) -> Command | Answer | None:
        """Handle a command of the generations without request ids."""
        match message:
            case CodedTag(tag=tag):
                question = self._plain(CommandId.TAG, asker, "G1")
                return replace(self._ask(question, "add_tag"), tag=tag)
            case TagG0() | TagG1():
                tag = tag_from_wire(message)
                question = self._plain(CommandId.TAG, asker, generation_of(message))
                return replace(self._ask(question, "add_tag"), tag=tag)
            case Asking():
                question = self._plain(message.COMMAND, asker, generation_of(message))
                return self._ask_with(question, message)
            case HeaderMessage(command=command):
                question = self._plain(command, asker, generation_of(message))
                return self._ask(question, COMMAND_OF_NUMBER[command].name)
            case _:
                # Acknowledgements, pulses and heartbeats are only sent by us.
                self.counters["payloads_ignored"] += 1
                return None

    def _plain(self, number: CommandId, asker: Asker, spoken: Generation | None) -> _Question:
        generation = self._fixed or spoken or self._heard
        return _Question(asker=asker, number=number, generation=generation, spoken=spoken)

    def _ask_with(self, question: _Question, message: Asking) -> Command:
        name = COMMAND_OF_NUMBER[message.COMMAND].name
        return message.asked(self._ask(question, name))

    def _ask(self, question: _Question, name: CommandName) -> Command:
        number = self.next_request_id()
        self._pending[number] = question
        if len(self._pending) > PENDING:
            self._pending.popitem(last=False)
            self.counters["replies_missing"] += 1
        self.counters["commands"] += 1
        asker = question.asker
        return Command(name=name, request_id=number, source=f"mavlink {asker[0]}/{asker[1]}")

    def _refusal(self, payload: bytes, reason: str, asker: Asker) -> Answer | None:
        """Refuse a payload that could not be read; None when it is no command."""
        number = acked_command_of(payload)
        if number is None or number == CommandId.ACK:
            return None
        generation = self.generation
        request_id = int.from_bytes(payload[4:8], "little") if generation == "G2" else 0
        message = ack_to_wire(number, False, reason, generation, request_id)
        return Answer(message.encode(), asker)

    def _answer(self, question: _Question, accepted: bool, text: str) -> Answer:
        message = ack_to_wire(
            question.number, accepted, text, question.generation, question.request_id
        )
        payload = message.encode()
        self._requests.answered(question.asker, question.request_id, payload)
        return Answer(payload, question.asker)
