"""The drone's side of the tunnel's conversation, without I/O.

Payloads of ground stations become commands for the supervisor; its replies become
acknowledgements to whoever asked; pulses and states become payloads in the generation that the
ground speaks.
"""

from collections import Counter, OrderedDict
from dataclasses import dataclass
from typing import Literal

from uavrt.errors import TunnelError
from uavrt.messages import Command, CommandReply, PulsePose, SearchReport, SystemState
from uavrt.tunnel.codec import TunnelMessage, acked_command_of, decode, generation_of
from uavrt.tunnel.convert import (
    COMMAND_NAMES,
    ack_to_wire,
    detector_heartbeat,
    heartbeat_to_wire,
    pulse_to_wire,
    search_report_to_wire,
    tag_from_wire,
)
from uavrt.tunnel.header import HeaderMessage
from uavrt.tunnel.raw_capture import RawCapture
from uavrt.tunnel.start_detection import StartDetection
from uavrt.tunnel.tag import TagG0, TagG1
from uavrt.tunnel.wire import CommandId, Generation

Asker = tuple[int, int]
"""System and component id of a ground station."""

PENDING = 64
"""Commands that may wait for the supervisor's reply; it answers in milliseconds."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A payload for the one who asked."""

    payload: bytes
    asker: Asker


@dataclass(frozen=True, slots=True)
class _Pending:
    asker: Asker
    command: CommandId
    generation: Generation


class Exchange:
    """Keeps who asked what, and in which generation the ground speaks.

    Parameters
    ----------
    generation : {"auto", "G0", "G1"}
        What we send. "auto" answers each in the generation of its own message, and sends the
        pulses in the generation of the last upload of tags, G1 before any.
    """

    def __init__(self, generation: Literal["auto", "G0", "G1"] = "auto") -> None:
        self._fixed: Generation | None = None if generation == "auto" else generation
        self._heard: Generation = "G1"
        self._pending: OrderedDict[int, _Pending] = OrderedDict()
        self._next_id = 1
        self.counters: Counter[str] = Counter()

    @property
    def generation(self) -> Generation:
        """In which generation pulses go out."""
        return self._fixed or self._heard

    def refuse(self, payload: bytes, reason: str, asker: Asker) -> Answer | None:
        """Refuse a payload unread; None when it is no command."""
        self.counters["commands_not_allowed"] += 1
        command = acked_command_of(payload)
        if command is None or command == CommandId.ACK:
            return None
        return self._answer(command, False, reason, asker)

    def receive(self, payload: bytes, asker: Asker) -> Command | Answer | None:
        """Take a payload of a ground station.

        Returns
        -------
        Command, Answer or None
            A command for the supervisor; or the answer to a payload that is none; or None for
            what needs no answer.
        """
        try:
            message = decode(payload)
            self._heard = generation_of(message) or self._heard
            return self._command(message, asker)
        except TunnelError as error:
            self.counters["payloads_refused"] += 1
            command = acked_command_of(payload)
            if command is None or command == CommandId.ACK:
                return None
            return self._answer(command, False, str(error), asker)

    def reply(self, reply: CommandReply) -> Answer | None:
        """Turn the supervisor's reply into the asker's acknowledgement."""
        pending = self._pending.pop(reply.request_id, None)
        if pending is None:
            return None
        message = ack_to_wire(
            pending.command, reply.accepted, reply.message, pending.generation
        )
        return Answer(message.encode(), pending.asker)

    def pulse(self, pulse_pose: PulsePose) -> bytes:
        """Get the payload of a pulse."""
        return pulse_to_wire(pulse_pose, self.generation).encode()

    def search_report(self, report: SearchReport) -> bytes | None:
        """Get the payload of "searched, nothing found"; the thesis's generation has none."""
        if self.generation == "G0":
            return None
        return search_report_to_wire(report).encode()

    def detector_heartbeat(self, tag_id: int, time_ns: int) -> bytes | None:
        """Get the payload of a detector's sign of life; the thesis's generation has none."""
        if self.generation == "G0":
            return None
        return detector_heartbeat(tag_id, time_ns).encode()

    def heartbeat(self, state: SystemState, cpu_temperature_c: float | None) -> bytes | None:
        """Get the payload of the 1 Hz heartbeat; the thesis's generation has none."""
        if self.generation == "G0":
            return None
        return heartbeat_to_wire(state, cpu_temperature_c).encode()

    def next_request_id(self) -> int:
        """Give a number to a command that comes by another way than the tunnel."""
        self._next_id += 1
        return self._next_id - 1

    def _command(self, message: TunnelMessage, asker: Asker) -> Command | Answer | None:
        match message:
            case TagG0() | TagG1():
                return self._ask(
                    CommandId.TAG,
                    asker,
                    Command(
                        name="add_tag", request_id=self._next_id, tag=tag_from_wire(message)
                    ),
                )
            case StartDetection():
                return self._ask(
                    CommandId.START_DETECTION,
                    asker,
                    Command(
                        name="start_detection",
                        request_id=self._next_id,
                        center_frequency_hz=message.radio_center_frequency_hz or None,
                        gain=message.gain or None,
                    ),
                )
            case RawCapture():
                return self._ask(
                    CommandId.RAW_CAPTURE,
                    asker,
                    Command(
                        name="raw_capture",
                        request_id=self._next_id,
                        center_frequency_hz=message.frequency_hz or None,
                        gain=message.gain or None,
                    ),
                )
            case HeaderMessage(command=command) if CommandId(command) in COMMAND_NAMES:
                number = CommandId(command)
                return self._ask(
                    number,
                    asker,
                    Command(name=COMMAND_NAMES[number], request_id=self._next_id),
                )
            case HeaderMessage(command=command):
                self.counters["commands_unsupported"] += 1
                return self._answer(command, False, "not supported", asker)
            case _:
                # Acknowledgements, pulses and heartbeats are ours to send, not to get.
                self.counters["payloads_ignored"] += 1
                return None

    def _ask(self, number: CommandId, asker: Asker, command: Command) -> Command:
        self._pending[self._next_id] = _Pending(asker, number, self.generation)
        self._next_id += 1
        if len(self._pending) > PENDING:
            self._pending.popitem(last=False)
            self.counters["replies_missing"] += 1
        self.counters["commands"] += 1
        return Command(
            name=command.name,
            request_id=command.request_id,
            tag=command.tag,
            center_frequency_hz=command.center_frequency_hz,
            gain=command.gain,
            source=f"mavlink {asker[0]}/{asker[1]}",
        )

    def _answer(self, command: int, accepted: bool, text: str, asker: Asker) -> Answer:
        message = ack_to_wire(command, accepted, text, self.generation)
        return Answer(message.encode(), asker)
