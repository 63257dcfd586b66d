"""The drone's side of the tunnel protocol, without I/O.

Payloads from ground stations become commands for the supervisor. The supervisor's replies
become acknowledgements to the senders. Pulses and states become payloads in the protocol
generation that the ground station uses.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from uavrt.core.clock import monotonic_s
from uavrt.core.commands import (
    COMMAND_OF_NUMBER,
    COMMANDS,
    CommandId,
    CommandName,
    Generation,
    SystemState,
)
from uavrt.core.errors import ConfigError, TunnelError
from uavrt.core.messages import Command, CommandReply, Operation, PulsePose, SearchReport
from uavrt.core.newest import Newest
from uavrt.link.tunnel.generations import g2
from uavrt.link.tunnel.generations.codec import (
    TunnelMessage,
    acked_command_of,
    decode,
    generation_of,
)
from uavrt.link.tunnel.generations.g0 import HeaderMessage, TagG0
from uavrt.link.tunnel.generations.g1 import TagG1
from uavrt.link.tunnel.generations.wire import CommandMessage, Ids
from uavrt.link.tunnel.own_messages.coded_tag import CodedTag
from uavrt.link.tunnel.requests import RequestCache, TagUpload, open_upload
from uavrt.link.tunnel.tunnel_records import (
    ack_to_wire,
    detector_heartbeat,
    heartbeat_to_wire,
    in_generation,
    pulse_to_wire,
    search_report_to_wire,
    tag_from_wire,
)

PENDING = 64
"""Largest number of commands that wait for the supervisor's reply, which takes milliseconds."""
PROGRESS_VERSION, ALIVE_VERSION = 5, 6
"""First tunnel protocol versions with OPERATION_PROGRESS and with DETECTOR_HEARTBEAT."""
STATES = {"running": g2.RUNNING, "complete": g2.COMPLETE, "failed": g2.FAILED}


@dataclass(frozen=True, slots=True)
class Answer:
    """A payload for the ground station that sent a request."""

    payload: bytes
    requester: Ids


@dataclass(frozen=True, slots=True, kw_only=True)
class _PendingCommand:
    """A command that waits for the supervisor's reply, with sender and generation."""

    requester: Ids
    number: int
    generation: Generation
    request_id: int = 0
    tag_index: int | None = None
    sender_generation: Generation | None = None
    """Protocol generation of the sender; None if its messages do not show it."""
    upload: TagUpload | None = None
    """Tag upload that this request begins if it is accepted; None if it begins none."""


class Operations:
    """Reports the progress of operations to the ground stations that started them.

    `version`: protocol version that the drone sends.
    """

    def __init__(self, version: int) -> None:
        self._version = version
        self._questions: dict[CommandName, _PendingCommand] = {}
        self._last: dict[CommandName, Operation] = {}

    def begun(self, name: CommandName, question: _PendingCommand) -> None:
        """Record which request started an operation; its sender gets the progress."""
        self._questions[name] = question

    def progress(self, operation: Operation) -> Answer | None:
        """Make a progress message of an operation; None if no station supports them."""
        self._last[operation.name] = operation
        answer = self._step(operation)
        if operation.state != "running":
            del self._last[operation.name]
            self._questions.pop(operation.name, None)
        return answer

    def again(self) -> list[Answer]:
        """Latest progress message of each running operation, to be sent each second."""
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
        return Answer(step.encode(), question.requester)


class Exchange:
    """Stores pending requests, and the protocol generation of the ground stations.

    `generation`: generation of sent messages. "auto" answers each station in its own
    generation, and sends pulses in that of the last tag upload, G1 before any. The numbered
    versions must be set, because their stations send nothing before they have received their
    own number. `version`: number sent with G2, 4 to 7. `experimental`: allows inferred layouts.
    Raises `ConfigError`: G2 without `experimental`.
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
                "protocol generation G2 is experimental: some message layouts are untested",
                remedy="Choose another mavlink.tunnel_generation, or set "
                "mavlink.tunnel_experimental = true",
            )
        self._fixed: Generation | None = None if generation == "auto" else generation
        self._version, self._experimental = version, experimental
        self._clock_s = clock_s
        self._heard: Generation = "G1"
        self._pending: Newest[int, _PendingCommand] = Newest(PENDING)
        self._next_id = 1
        self._requests = RequestCache()
        self._upload: TagUpload | None = None
        self.operations = Operations(version)
        self.counters: Counter[str] = Counter()

    @property
    def generation(self) -> Generation:
        """Protocol generation of the pulse messages sent."""
        return self._fixed or self._heard

    def refuse(self, payload: bytes, reason: str, requester: Ids) -> Answer | None:
        """Make the acknowledgement that refuses an unread payload; None if no command."""
        self.counters["commands_not_allowed"] += 1
        return self._refusal(payload, reason, requester)

    def receive(
        self, payload: bytes, requester: Ids, *, coded_tag: bool = False
    ) -> Command | Answer | None:
        """Handle a ground station's payload; return a command, an answer or None."""
        try:
            message = CodedTag.decode(payload) if coded_tag else decode(payload)
            if isinstance(message, g2.Requests):
                return self._request(message, payload, requester)
            if isinstance(message, CodedTag) and message.request_id:
                return self._request(message, payload, requester)
            return self._command(message, requester)
        except TunnelError as error:
            self.counters["payloads_refused"] += 1
            return self._refusal(payload, str(error), requester)

    def reply(self, reply: CommandReply) -> Answer | None:
        """Convert the supervisor's reply to an acknowledgement for the sender."""
        question = self._pending.pop(reply.request_id, None)
        if question is None:
            return None
        if reply.accepted:
            # Only now: a refused sender must not change the generation of others.
            self._heard = question.sender_generation or self._heard
            self._upload = question.upload or self._upload
        if reply.accepted and question.generation == "G2":
            if question.tag_index is not None and self._upload is not None:
                self._upload.indices.add(question.tag_index)
            self.operations.begun(reply.name, question)
        return self._answer(question, reply.accepted, reply.message)

    def pulse(self, pulse_pose: PulsePose) -> bytes:
        """Encode a pulse in the ground station's protocol generation."""
        return pulse_to_wire(pulse_pose, self.generation).encode()

    def search_report(self, report: SearchReport) -> bytes | None:
        """Encode the report "searched, nothing found"; None in G0, which lacks it."""
        if self.generation == "G0":
            return None
        return in_generation(search_report_to_wire(report), self.generation).encode()

    def detector_heartbeat(self, tag_id: int, time_ns: int) -> bytes | None:
        """Encode the heartbeat of a detector; None in generation G0, which lacks it."""
        if self.generation == "G0":
            return None
        if self.generation == "G2" and self._version >= ALIVE_VERSION:
            return g2.DetectorHeartbeat(tag_id=tag_id).encode()
        return in_generation(detector_heartbeat(tag_id, time_ns), self.generation).encode()

    def heartbeat(self, state: SystemState, cpu_temperature_c: float | None) -> bytes | None:
        """Encode the drone's heartbeat, sent once a second; None in generation G0, which lacks
        it.
        """
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
        """Return a new request number for a command from outside the tunnel."""
        self._next_id += 1
        return self._next_id - 1

    def _request(
        self, message: g2.Requests | CodedTag, payload: bytes, requester: Ids
    ) -> Command | Answer | None:
        """Handle a command of version 4 or later; a repeated one gets the same answer."""
        known = self._requests.repeated(requester, message.request_id, payload, self._clock_s())
        if known is True:
            return None  # its acknowledgement is on its way
        if known is not False:
            self.counters["acknowledgements_replayed"] += 1
            return Answer(known, requester)
        number = acked_command_of(payload)
        assert number is not None
        question = _PendingCommand(
            requester=requester, number=number, generation="G2", request_id=message.request_id
        )
        try:
            if isinstance(message, g2.INFERRED) and not self._experimental:
                raise TunnelError(
                    "experimental command refused: set mavlink.tunnel_experimental = true",
                    payload,
                )
            if self._experimental:
                question = replace(question, sender_generation="G2")
            return self._numbered_command(message, question)
        except TunnelError as error:
            self.counters["payloads_refused"] += 1
            return self._answer(question, False, str(error))

    def _numbered_command(
        self, message: g2.Requests | CodedTag, question: _PendingCommand
    ) -> Command | Answer:
        match message:
            case CodedTag():
                self._open_upload(message).check_tag(message, question.requester)
                question = replace(question, tag_index=message.tag_index)
                return replace(self._ask(question, "add_tag"), tag=message.tag)
            case g2.UploadG2(command=CommandId.START_TAGS):
                upload = open_upload(message, question.requester)
                return self._ask(replace(question, upload=upload), "start_tags")
            case g2.UploadG2():
                self._open_upload(message).check_end(message, question.requester)
                return self._ask(question, "end_tags")
            case g2.TagG2(upload_id=0):  # a correction in flight
                return replace(self._ask(question, "add_tag"), tag=tag_from_wire(message.tag))
            case g2.TagG2():
                self._open_upload(message).check_tag(message, question.requester)
                tag = tag_from_wire(message.tag)
                question = replace(question, tag_index=message.tag_index)
                return replace(self._ask(question, "add_tag"), tag=tag)
            case CommandMessage():
                return self._request_with(question, message)
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
        self, message: TunnelMessage | CodedTag, requester: Ids
    ) -> Command | Answer | None:
        """Handle a command of the protocol generations without request ids."""
        match message:
            case CodedTag(tag=tag):
                question = self._plain(CommandId.TAG, requester, "G1")
                return replace(self._ask(question, "add_tag"), tag=tag)
            case TagG0() | TagG1():
                tag = tag_from_wire(message)
                question = self._plain(CommandId.TAG, requester, generation_of(message))
                return replace(self._ask(question, "add_tag"), tag=tag)
            case CommandMessage():
                question = self._plain(message.command, requester, generation_of(message))
                return self._request_with(question, message)
            case HeaderMessage(command=command):
                question = self._plain(command, requester, generation_of(message))
                return self._ask(question, COMMAND_OF_NUMBER[command].name)
            case _:
                # Acknowledgements, pulses and heartbeats are only sent by us.
                self.counters["payloads_ignored"] += 1
                return None

    def _plain(
        self, number: CommandId, requester: Ids, sender_generation: Generation | None
    ) -> _PendingCommand:
        generation = self._fixed or sender_generation or self._heard
        return _PendingCommand(
            requester=requester,
            number=number,
            generation=generation,
            sender_generation=sender_generation,
        )

    def _request_with(self, question: _PendingCommand, message: CommandMessage) -> Command:
        row = COMMAND_OF_NUMBER[message.command]
        if fault := row.fault(message.numbers):
            raise TunnelError(fault, message.encode())
        return replace(self._ask(question, row.name), **row.members(message.numbers))

    def _ask(self, question: _PendingCommand, name: CommandName) -> Command:
        number = self.next_request_id()
        if len(self._pending) == PENDING:
            self.counters["replies_missing"] += 1
        self._pending[number] = question
        self.counters["commands"] += 1
        requester = question.requester
        return Command(
            name=name, request_id=number, source=f"mavlink {requester[0]}/{requester[1]}"
        )

    def _refusal(self, payload: bytes, reason: str, requester: Ids) -> Answer | None:
        """Make the acknowledgement that refuses an unreadable payload; None if no command."""
        number = acked_command_of(payload)
        if number is None or number == CommandId.ACK:
            return None
        generation = self.generation
        request_id = int.from_bytes(payload[4:8], "little") if generation == "G2" else 0
        message = ack_to_wire(number, False, reason, generation, request_id)
        return Answer(message.encode(), requester)

    def _answer(self, question: _PendingCommand, accepted: bool, text: str) -> Answer:
        message = ack_to_wire(
            question.number, accepted, text, question.generation, question.request_id
        )
        payload = message.encode()
        self._requests.answered(question.requester, question.request_id, payload)
        return Answer(payload, question.requester)
