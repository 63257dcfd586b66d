"""MAVLink: links, heartbeat, discovery, poses, tunnel transport.

`Connection` is what the drone's connection process runs; `Component`, `TimeSync`, `PacedQueue`
and the other parts know the protocol without I/O; `open_link` and `FrameWriter` are enough for
a ground station. The messages (`uavrt.mavlink.dialect`) are generated at package build.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.mavlink.address import Address, parse_address
    from uavrt.mavlink.component import Component, Handlers
    from uavrt.mavlink.connection import Connection
    from uavrt.mavlink.discovery import (
        GCS_SYSTEM_ID,
        STATION_SYSTEM_ID,
        Discovery,
        Peer,
        station_heartbeat,
    )
    from uavrt.mavlink.frame import (
        MARKER_V1,
        MARKER_V2,
        SIGNED,
        Frame,
        FrameParser,
        FrameWriter,
        crc16_mcrf4xx,
        encode_frame,
    )
    from uavrt.mavlink.ftp_files import FileTree
    from uavrt.mavlink.ftp_server import Disk, FileServer, at_once
    from uavrt.mavlink.ftp_wire import DATA_SIZE, FtpError, FtpPacket, Opcode, checksum
    from uavrt.mavlink.link import Link, LinkCounters
    from uavrt.mavlink.message import Message
    from uavrt.mavlink.metadata import component_metadata
    from uavrt.mavlink.mission_transfer import (
        MissionDownload,
        MissionTransfer,
        MissionUpload,
        homed,
    )
    from uavrt.mavlink.named_value import value_name
    from uavrt.mavlink.pacing import PacedQueue, Priority, Source, Tunnelled
    from uavrt.mavlink.parameter_client import ParameterClient
    from uavrt.mavlink.parameters import ParameterServer, Requests, decode_value
    from uavrt.mavlink.rate import LinkRate
    from uavrt.mavlink.samples import attitude_sample, is_place, position_sample
    from uavrt.mavlink.sender import TunnelSender
    from uavrt.mavlink.signing import (
        Signing,
        SigningKey,
        SigningTimes,
        read_signing_key,
        signing_from,
    )
    from uavrt.mavlink.statustext import TextAssembler, TextLimiter, chunks_of
    from uavrt.mavlink.timesync import TimeSync
    from uavrt.mavlink.transport import keep_open, open_link
    from uavrt.mavlink.vehicle_messages import (
        WATCHED_HZ,
        command_message,
        kind_of,
        observations,
    )
    from uavrt.mavlink.wind import wind_of

__all__ = [
    "DATA_SIZE",
    "GCS_SYSTEM_ID",
    "MARKER_V1",
    "MARKER_V2",
    "SIGNED",
    "STATION_SYSTEM_ID",
    "WATCHED_HZ",
    "Address",
    "Component",
    "Connection",
    "Discovery",
    "Disk",
    "FileServer",
    "FileTree",
    "Frame",
    "FrameParser",
    "FrameWriter",
    "FtpError",
    "FtpPacket",
    "Handlers",
    "Link",
    "LinkCounters",
    "LinkRate",
    "Message",
    "MissionDownload",
    "MissionTransfer",
    "MissionUpload",
    "Opcode",
    "PacedQueue",
    "ParameterClient",
    "ParameterServer",
    "Peer",
    "Priority",
    "Requests",
    "Signing",
    "SigningKey",
    "SigningTimes",
    "Source",
    "TextAssembler",
    "TextLimiter",
    "TimeSync",
    "TunnelSender",
    "Tunnelled",
    "at_once",
    "attitude_sample",
    "checksum",
    "chunks_of",
    "command_message",
    "component_metadata",
    "crc16_mcrf4xx",
    "decode_value",
    "encode_frame",
    "homed",
    "is_place",
    "keep_open",
    "kind_of",
    "observations",
    "open_link",
    "parse_address",
    "position_sample",
    "read_signing_key",
    "signing_from",
    "station_heartbeat",
    "value_name",
    "wind_of",
]
__getattr__ = lazily(
    __name__,
    {
        "Address": "address",
        "Component": "component",
        "Connection": "connection",
        "DATA_SIZE": "ftp_wire",
        "Discovery": "discovery",
        "Disk": "ftp_server",
        "FileServer": "ftp_server",
        "FileTree": "ftp_files",
        "Frame": "frame",
        "FrameParser": "frame",
        "FrameWriter": "frame",
        "FtpError": "ftp_wire",
        "FtpPacket": "ftp_wire",
        "GCS_SYSTEM_ID": "discovery",
        "Handlers": "component",
        "Link": "link",
        "LinkCounters": "link",
        "LinkRate": "rate",
        "MARKER_V1": "frame",
        "MARKER_V2": "frame",
        "Message": "message",
        "MissionDownload": "mission_transfer",
        "MissionTransfer": "mission_transfer",
        "MissionUpload": "mission_transfer",
        "Opcode": "ftp_wire",
        "PacedQueue": "pacing",
        "ParameterClient": "parameter_client",
        "ParameterServer": "parameters",
        "Peer": "discovery",
        "Priority": "pacing",
        "Requests": "parameters",
        "SIGNED": "frame",
        "STATION_SYSTEM_ID": "discovery",
        "Signing": "signing",
        "SigningKey": "signing",
        "SigningTimes": "signing",
        "Source": "pacing",
        "TextAssembler": "statustext",
        "TextLimiter": "statustext",
        "TimeSync": "timesync",
        "TunnelSender": "sender",
        "Tunnelled": "pacing",
        "WATCHED_HZ": "vehicle_messages",
        "at_once": "ftp_server",
        "attitude_sample": "samples",
        "checksum": "ftp_wire",
        "chunks_of": "statustext",
        "command_message": "vehicle_messages",
        "homed": "mission_transfer",
        "component_metadata": "metadata",
        "crc16_mcrf4xx": "frame",
        "decode_value": "parameters",
        "encode_frame": "frame",
        "kind_of": "vehicle_messages",
        "observations": "vehicle_messages",
        "keep_open": "transport",
        "open_link": "transport",
        "parse_address": "address",
        "is_place": "samples",
        "position_sample": "samples",
        "read_signing_key": "signing",
        "signing_from": "signing",
        "station_heartbeat": "discovery",
        "value_name": "named_value",
        "wind_of": "wind",
    },
)
