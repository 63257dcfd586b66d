"""A link between an autopilot and its peer that stores each frame."""

import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from uavrt.analysis.tracks.tlog import stamped_frames
from uavrt.core.clock import Clock
from uavrt.core.units import s_from_ns
from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.datagrams import DatagramPort

_STAMP = struct.Struct(">Q")
"""Time stamp before each frame of a .tlog: microseconds since 1970."""
DRONE = 191
"""MAVLink component of uavrt on the drone: its frames are outgoing, all others incoming."""


@dataclass(frozen=True, slots=True)
class Kept:
    """One stored frame of the link."""

    time_s: float
    frame: Frame

    @property
    def ours(self) -> bool:
        """True if uavrt on the drone sent the frame."""
        return self.frame.component_id == DRONE

    @property
    def message(self) -> Message | None:
        """Decoded message of the frame."""
        return self.frame.message()


class Tap:
    """Forwards datagrams in both directions, and stores them.

    `autopilot`: address of the autopilot's link.
    `port`: local port; 0: any.
    `peer`: address of the product.
    """

    def __init__(
        self, autopilot: tuple[str, int], port: int, peer: tuple[str, int], clock: Clock
    ) -> None:
        self._clock = clock
        self._autopilot = DatagramPort(autopilot, port, self._from_autopilot, clock)
        self._peer = DatagramPort(peer, 0, self._from_peer, clock)
        self._parsers = FrameParser(), FrameParser()
        self.kept: list[Kept] = []
        self.cut = False
        """True: the link is cut, and no datagram passes."""
        self.latest_s = 0.0
        """Longest time from a datagram's arrival to its forwarding [s]; the reader resets it to
        0.

        The stored times are those of the arrivals, so they do not show this delay.
        """
        self.heard: Callable[[Kept], None] = lambda _: None
        """Called with each frame of the autopilot."""

    def open(self) -> None:
        """Open the sockets of the link; raises `LinkError`."""
        self._autopilot.open()
        self._peer.open()

    def close(self) -> None:
        """Close the sockets of the link."""
        self._autopilot.close()
        self._peer.close()

    def inject(self, writer: FrameWriter, message: Message) -> None:
        """Send a message to the autopilot from another sender than the peer."""
        if not self.cut:
            self._autopilot.send(writer.encode(message))

    def _from_autopilot(self, data: bytes, arrival_ns: int) -> None:
        if self.cut:
            return
        self._peer.send(data)
        self._forwarded(arrival_ns)
        for one in self._keep(self._parsers[0], data, arrival_ns):
            self.heard(one)

    def _from_peer(self, data: bytes, arrival_ns: int) -> None:
        if self.cut:
            return
        self._autopilot.send(data)
        self._forwarded(arrival_ns)
        list(self._keep(self._parsers[1], data, arrival_ns))

    def _forwarded(self, arrival_ns: int) -> None:
        self.latest_s = max(self.latest_s, s_from_ns(self._clock.now_ns() - arrival_ns))

    def _keep(self, parser: FrameParser, data: bytes, time_ns: int) -> Iterator[Kept]:
        for frame in parser.feed(data):
            one = Kept(s_from_ns(time_ns), frame)
            self.kept.append(one)
            yield one


def write_frames(path: Path, kept: Iterable[Kept]) -> None:
    """Write frames as a .tlog, which other MAVLink tools can read."""
    with path.open("wb") as file:
        for one in kept:
            file.write(_STAMP.pack(round(one.time_s * 1e6)) + one.frame.raw)


def read_frames(path: Path) -> list[Kept]:
    """Read all complete frames of a .tlog, even if a crash cut its end off."""
    frames = stamped_frames(path.read_bytes())
    return [Kept(stamp_us / 1e6, frame) for stamp_us, frame in frames]
