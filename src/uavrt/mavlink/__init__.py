"""MAVLink: links, heartbeat, discovery, poses, tunnel transport.

`Connection` is what the drone's connection process runs; `Component`, `TimeSync`, `PacedQueue`
and the other parts know the protocol without I/O; `open_link` and `FrameWriter` are enough for
a ground station. The messages (`uavrt.mavlink.dialect`) are generated at package build.
"""

from uavrt.mavlink.address import Address, parse_address
from uavrt.mavlink.component import Component, Handlers
from uavrt.mavlink.connection import Connection
from uavrt.mavlink.discovery import Discovery, Peer
from uavrt.mavlink.frame import Frame, FrameParser, FrameWriter, encode_frame
from uavrt.mavlink.link import Link, LinkCounters
from uavrt.mavlink.message import Message
from uavrt.mavlink.pacing import PacedQueue, Priority, Source
from uavrt.mavlink.rate import LinkRate
from uavrt.mavlink.sender import TunnelSender
from uavrt.mavlink.statustext import TextAssembler, chunks_of
from uavrt.mavlink.timesync import TimeSync
from uavrt.mavlink.transport import open_link

__all__ = [
    "Address",
    "Component",
    "Connection",
    "Discovery",
    "Frame",
    "FrameParser",
    "FrameWriter",
    "Handlers",
    "Link",
    "LinkCounters",
    "LinkRate",
    "Message",
    "PacedQueue",
    "Peer",
    "Priority",
    "Source",
    "TextAssembler",
    "TimeSync",
    "TunnelSender",
    "chunks_of",
    "encode_frame",
    "open_link",
    "parse_address",
]
