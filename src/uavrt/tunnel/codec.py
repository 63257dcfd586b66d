"""Payload bytes to messages, chosen by command and length, and back."""

from collections.abc import Callable

from uavrt.errors import TunnelError
from uavrt.tunnel import numbered
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
    | numbered.BareG2
    | numbered.UploadG2
    | numbered.TagG2
    | numbered.StartDetectionG2
    | numbered.RawCaptureG2
    | numbered.SetLogLevel
    | numbered.AckG2
    | numbered.OperationProgress
    | numbered.HeartbeatG2v1
    | numbered.HeartbeatG2
    | numbered.DetectorHeartbeat
    | numbered.PulseG2v1
    | numbered.PulseG2
)

BARE_COMMANDS = (
    CommandId.STOP_DETECTION,
    CommandId.SAVE_LOGS,
    CommandId.CLEAN_LOGS,
    CommandId.AIRSPY_STATUS,
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
    **{(int(command), 8): numbered.BareG2.decode for command in BARE_COMMANDS},
    (CommandId.START_TAGS, 16): numbered.UploadG2.decode,
    (CommandId.END_TAGS, 16): numbered.UploadG2.decode,
    (CommandId.TAG, 96): numbered.TagG2.decode,
    (CommandId.START_DETECTION, 48): numbered.StartDetectionG2.decode,
    (CommandId.RAW_CAPTURE, 16): numbered.RawCaptureG2.decode,
    (CommandId.SET_LOG_LEVEL, 12): numbered.SetLogLevel.decode,
    (CommandId.OPERATION_PROGRESS, 128): numbered.OperationProgress.decode,
    (CommandId.HEARTBEAT, 16): numbered.HeartbeatG2v1.decode,
    (CommandId.HEARTBEAT, 20): numbered.HeartbeatG2.decode,
    (CommandId.DETECTOR_HEARTBEAT, 16): numbered.DetectorHeartbeat.decode,
}
"""What to do with a payload of (command, length); the lengths tell the generations apart."""

SAME_LENGTH: dict[Generation, dict[tuple[int, int], Callable[[bytes], TunnelMessage]]] = {
    "G2v1": {(CommandId.PULSE, 128): numbered.PulseG2v1.decode},
    "G2": {
        (CommandId.PULSE, 120): numbered.PulseG2.decode,
        (CommandId.ACK, 128): numbered.AckG2.decode,
    },
}
"""Of a drone's messages these have the length of an older one: the ground must know which."""


def decode(payload: bytes, generation: Generation | None = None) -> TunnelMessage:
    """Read a tunnel payload (its first ``payload_length`` bytes).

    Parameters
    ----------
    payload : bytes
        What came.
    generation : str, optional
        What the drone speaks, where a length stands for several messages; ours need none.

    Raises
    ------
    TunnelError
        Unknown command, or a length that the command never has. Holds the payload; its text
        is fit for the acknowledgement (`acked_command_of` tells whom to answer).
    """
    if not 4 <= len(payload) <= MAX_PAYLOAD:
        raise TunnelError(f"a payload has 4 to 128 bytes, not {len(payload)}", payload)
    command = int.from_bytes(payload[:4], "little")
    kind = (command, len(payload))
    own = SAME_LENGTH.get(generation, {}) if generation is not None else {}
    decoder = own.get(kind) or DECODERS.get(kind)
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
        case (
            numbered.BareG2()
            | numbered.UploadG2()
            | numbered.TagG2()
            | numbered.StartDetectionG2()
            | numbered.RawCaptureG2()
            | numbered.SetLogLevel()
        ):
            return "G2"
        case HeaderMessage(command=CommandId.START_DETECTION):
            return "G0"
        case HeaderMessage(command=CommandId.START_TAGS | CommandId.END_TAGS):
            return None
        case HeaderMessage(command=CommandId.STOP_DETECTION):
            return None
        case _:
            return "G1"
