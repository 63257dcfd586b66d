"""Payload bytes to messages, chosen by command and length, and back."""

from collections.abc import Callable

from uavrt.errors import TunnelError
from uavrt.tunnel.ack import AckG0, AckG1
from uavrt.tunnel.header import HEADER_COMMANDS, HeaderMessage
from uavrt.tunnel.heartbeat import Heartbeat
from uavrt.tunnel.pulse import PulseG0, PulseG1
from uavrt.tunnel.raw_capture import RawCapture
from uavrt.tunnel.start_detection import StartDetection
from uavrt.tunnel.tag import TagG0, TagG1
from uavrt.tunnel.wire import MAX_PAYLOAD, CommandId, Generation

TunnelMessage = (
    HeaderMessage
    | AckG0
    | AckG1
    | TagG0
    | TagG1
    | StartDetection
    | RawCapture
    | PulseG0
    | PulseG1
    | Heartbeat
)

DECODERS: dict[tuple[int, int], Callable[[bytes], TunnelMessage]] = {
    **{(int(command), 4): HeaderMessage.decode for command in HEADER_COMMANDS},
    (CommandId.ACK, 12): AckG0.decode,
    (CommandId.ACK, 128): AckG1.decode,
    (CommandId.TAG, 48): TagG0.decode,
    (CommandId.TAG, 88): TagG1.decode,
    (CommandId.START_DETECTION, 12): StartDetection.decode,
    (CommandId.START_DETECTION, 16): StartDetection.decode,
    (CommandId.START_DETECTION, 32): StartDetection.decode,
    (CommandId.START_DETECTION, 40): StartDetection.decode,
    (CommandId.RAW_CAPTURE, 8): RawCapture.decode,
    (CommandId.RAW_CAPTURE, 12): RawCapture.decode,
    (CommandId.PULSE, 128): PulseG0.decode,
    (CommandId.PULSE, 120): PulseG1.decode,
    (CommandId.HEARTBEAT, 12): Heartbeat.decode,
}
"""What to do with a payload of (command, length); the lengths tell the generations apart."""


def decode(payload: bytes) -> TunnelMessage:
    """Read a tunnel payload (its first ``payload_length`` bytes).

    Raises
    ------
    TunnelError
        Unknown command, or a length that the command never has. Holds the payload; its text
        is fit for the acknowledgement (`acked_command_of` tells whom to answer).
    """
    if not 4 <= len(payload) <= MAX_PAYLOAD:
        raise TunnelError(f"a payload has 4 to 128 bytes, not {len(payload)}", payload)
    command = int.from_bytes(payload[:4], "little")
    decoder = DECODERS.get((command, len(payload)))
    if decoder is not None:
        return decoder(payload)
    lengths = sorted(length for known, length in DECODERS if known == command)
    if not lengths:
        raise TunnelError(f"unknown command {command}", payload)
    choice = " or ".join(str(length) for length in lengths)
    name = CommandId(command).name
    raise TunnelError(f"{name} has {len(payload)} bytes, not {choice}", payload)


def acked_command_of(payload: bytes) -> int | None:
    """Number of the command in a payload, also of an invalid one; None if too short."""
    return int.from_bytes(payload[:4], "little") if len(payload) >= 4 else None


def generation_of(message: TunnelMessage) -> Generation | None:
    """Which generation's sender writes this message; None when both do."""
    match message:
        case AckG0() | TagG0() | PulseG0():
            return "G0"
        case HeaderMessage(command=CommandId.START_DETECTION):
            return "G0"
        case HeaderMessage(command=CommandId.START_TAGS | CommandId.END_TAGS):
            return None
        case HeaderMessage(command=CommandId.STOP_DETECTION):
            return None
        case _:
            return "G1"
