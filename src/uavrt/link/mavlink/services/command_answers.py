"""Answer MAVLink commands: each gets one acknowledgement, sent to its sender; no I/O."""

from importlib.metadata import version

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavCmd, MavProtocolCapability, MavResult
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.services.metadata import Metadata


def capabilities(*, bytewise: bool) -> int:
    """MAV_PROTOCOL_CAPABILITY bits; `bytewise`: True if integer parameters are bytes."""
    encoding = (
        MavProtocolCapability.PARAM_ENCODE_BYTEWISE
        if bytewise
        else MavProtocolCapability.PARAM_ENCODE_C_CAST
    )
    return (
        MavProtocolCapability.MAVLINK2
        | MavProtocolCapability.COMMAND_INT
        | MavProtocolCapability.FTP
        | encoding
    )


def answer_command(
    message: dialect.CommandLong | dialect.CommandInt,
    sender: Peer,
    *,
    direct: bool,
    uptime_ms: int,
    bytewise: bool = True,
    metadata: Metadata | None = None,
) -> list[Message]:
    """Return the messages that answer a command; `direct`: it is addressed to this component.

    A command to all components is answered only if this one serves it. A ground station could
    take "not supported" for the autopilot's refusal of a take-off.
    """
    asked = _asked_message(message)
    if asked == dialect.ComponentMetadata.ID and metadata is not None:
        return [
            _ack(message.command, MavResult.ACCEPTED, sender),
            dialect.ComponentMetadata(
                time_boot_ms=uptime_ms & 0xFFFFFFFF, file_crc=metadata.crc, uri=metadata.uri
            ),
        ]
    reply = (
        None if asked is None else _identity(asked, uptime_ms, capabilities(bytewise=bytewise))
    )
    if reply is not None:
        return [_ack(message.command, MavResult.ACCEPTED, sender), reply]
    return [_ack(message.command, MavResult.UNSUPPORTED, sender)] if direct else []


def _asked_message(message: dialect.CommandLong | dialect.CommandInt) -> int | None:
    """Id of the message that a command requests; None for any other command."""
    match message.command:
        case MavCmd.REQUEST_MESSAGE:
            param1 = message.param1
            return int(param1) if 0 <= param1 < 2**24 else None
        case MavCmd.REQUEST_AUTOPILOT_CAPABILITIES:
            return dialect.AutopilotVersion.ID
        case MavCmd.REQUEST_PROTOCOL_VERSION:
            return dialect.ProtocolVersion.ID
        case _:
            return None


def _identity(message_id: int, uptime_ms: int, able: int) -> Message | None:
    """Return the message with this id if it reports version or capabilities (`able`), else
    None.
    """
    match message_id:
        case dialect.AutopilotVersion.ID:
            return dialect.AutopilotVersion(
                capabilities=able,
                flight_sw_version=_version_number(),
                flight_custom_version=bytes(8),
                middleware_custom_version=bytes(8),
                os_custom_version=bytes(8),
            )
        case dialect.ProtocolVersion.ID:
            return dialect.ProtocolVersion(
                version=200,
                min_version=100,
                max_version=200,
                spec_version_hash=bytes(8),
                library_version_hash=bytes(8),
            )
        case dialect.ComponentInformationBasic.ID:
            return dialect.ComponentInformationBasic(
                time_boot_ms=uptime_ms & 0xFFFFFFFF,
                capabilities=able,
                vendor_name="uavrt",
                model_name="radio-tag receiver",
                software_version=version("uavrt"),
                hardware_version="",
                serial_number="",
            )
        case _:
            return None


def _version_number() -> int:
    """Version of uavrt as MAVLink writes versions: one byte each, major first."""
    major, minor, patch = (int(part) for part in version("uavrt").split(".")[:3])
    return major << 24 | minor << 16 | patch << 8


def _ack(command: int, result: int, target: Peer) -> dialect.CommandAck:
    return dialect.CommandAck(command=command, result=result, **target.address)
