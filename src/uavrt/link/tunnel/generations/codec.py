"""Convert payload bytes to messages, chosen by command and length, and back."""

from typing import cast

from uavrt.core.commands import BARE, COMMAND_OF_NUMBER, CommandId, Generation
from uavrt.core.errors import TunnelError
from uavrt.link.tunnel.generations import g0, g1, g2
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD

TunnelMessage = g0.Messages | g1.Messages | g2.Messages

DECODERS = {**g0.DECODERS, **g1.DECODERS, **g2.DECODERS}
"""Decoders by command and payload length; the lengths distinguish the protocol generations."""


def decode(payload: bytes, generation: Generation | None = None) -> TunnelMessage:
    """Decode a tunnel payload (its first ``payload_length`` bytes).

    `generation`: the drone's generation, needed where several messages have the same length.
    Raises `TunnelError`, with the payload, for an unknown command or a wrong length; the
    acknowledgement (to `acked_command_of`) can carry its text.
    """
    if not 4 <= len(payload) <= MAX_PAYLOAD:
        raise TunnelError(f"a payload must have 4 to 128 bytes, not {len(payload)}", payload)
    command = int.from_bytes(payload[:4], "little")
    kind = (command, len(payload))
    own = g2.SAME_LENGTH.get(generation, {}) if generation is not None else {}
    decoder = own.get(kind) or DECODERS.get(kind)
    if decoder is not None:
        return cast(TunnelMessage, decoder(payload))
    lengths = sorted(length for known, length in DECODERS if known == command)
    if not lengths:
        raise TunnelError(f"unknown command {command}", payload)
    choice = " or ".join(str(length) for length in lengths)
    name = CommandId(command).name
    raise TunnelError(f"{name} has {len(payload)} bytes, not {choice}", payload)


def acked_command_of(payload: bytes) -> int | None:
    """Command number in a payload, also of an invalid one; None if it is too short."""
    return int.from_bytes(payload[:4], "little") if len(payload) >= 4 else None


def generation_of(message: TunnelMessage) -> Generation | None:
    """Protocol generation that alone uses this message; None if several generations use it."""
    match message:
        case g0.HeaderMessage(command=number):
            lengths = COMMAND_OF_NUMBER[number].lengths
            writers = [name for name, bare in lengths.items() if bare == BARE]
            return writers[0] if len(writers) == 1 else None
        case _ if isinstance(message, g0.Messages):
            return "G0"
        case _ if isinstance(message, g2.Requests):
            return "G2"
        case _:
            return "G1"
