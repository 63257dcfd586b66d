"""Links over UDP.

At 260 messages a second, one every 4 ms, a wake-up for each would cost more than reading them.
So a wake-up empties the socket, which is then polled every `REST_S` until it is quiet; commands
wait up to 8 ms. The age of a frame is read from the kernel's time stamp, so that clocks are
compared by the time of arrival.
"""

import asyncio
import socket
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from uavrt.core.clock import monotonic_s, wall_ns
from uavrt.core.errors import LinkError, os_errors_as
from uavrt.core.log import get_logger
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.link.mavlink.links.address import Address
from uavrt.link.mavlink.links.mavlink_link import RETRY_S, Link, Parser

log = get_logger()

REST_S = 0.008
"""Time between two polls of the socket [s]; PX4 polls a link of 1200 B/s once in 8 ms."""
PEER_SILENCE_S = 30.0
"""Silence of a peer after which nothing is sent to it [s]."""
MAX_PEERS = 24
DATAGRAM = 2048
RECEIVE_BUFFER = 1 << 18
SO_TIMESTAMPNS = 35
"""Linux option for time stamps in ns (asm-generic/socket.h); Python names it from 3.14."""
OLDEST_NS = 10_000_000_000
"""Maximum plausible age of a datagram [ns]; above it, the wall clock must have stepped."""
_TIMESPEC = struct.Struct("@ll")
_GONE = (ConnectionRefusedError, ConnectionResetError)


class UdpLink(Link):
    """UDP link: ``udpin`` receives and answers every sender, ``udpout`` sends to one."""

    def __init__(
        self, address: Address, on_frame: Callable[[Any], None], parser: Parser | None = None
    ) -> None:
        super().__init__(address, on_frame, parser)
        self._socket: socket.socket | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._peers: dict[tuple[str, int], float] = {}
        self._closed = False
        self._watched = False

    async def open(self) -> None:
        """Bind or connect the socket."""
        listen = self.address.kind == "udpin"
        with os_errors_as(
            LinkError,
            self.address,
            f"Port {self.address.port} may be in use by another program "
            "(`ss -ulpn` shows which), or the address does not belong to this computer",
        ):
            found = await asyncio.get_running_loop().getaddrinfo(
                self.address.host, self.address.port, type=socket.SOCK_DGRAM
            )
            family, kind, protocol, _, place = found[0]
            opened = socket.socket(family, kind, protocol)
            try:
                opened.setblocking(False)
                opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
                if sys.platform == "linux":
                    # An emulator has no stamps: a frame's age is then counted from its reading.
                    with suppress(OSError):
                        opened.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
                if listen:
                    opened.bind(place)
                else:
                    opened.connect(place)
            except OSError:
                opened.close()
                raise
        self._socket = opened
        self._listen()

    @property
    def local_port(self) -> int:
        """Port number of the socket, also if the system chose it."""
        assert self._socket is not None
        port: int = self._socket.getsockname()[1]
        return port

    async def close(self) -> None:
        """Close the UDP socket."""
        self._closed = True
        self._release()

    def _release(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._socket is not None:
            self._deaf()
            self._socket.close()
            self._socket = None

    def _listen(self) -> None:
        """Wait for the next datagram, then read all waiting datagrams."""
        assert self._socket is not None
        try:
            asyncio.get_running_loop().add_reader(self._socket.fileno(), self._woken)
            self._watched = True
        except NotImplementedError:  # Windows: look by the clock
            self._rest()

    def _deaf(self) -> None:
        if self._watched and self._socket is not None:
            asyncio.get_running_loop().remove_reader(self._socket.fileno())
        self._watched = False

    def _rest(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(REST_S, self._read_after_pause)

    def _woken(self) -> None:
        self._deaf()
        try:
            self._read_all()
        finally:
            if self._socket is not None:
                self._rest()

    def _read_after_pause(self) -> None:
        """Read the socket after a pause; if it is empty, wait for the next datagram."""
        self._timer = None
        found = True
        try:
            found = self._read_all()
        finally:
            if self._socket is not None:
                (self._rest if found else self._listen)()

    def _read_all(self) -> bool:
        """Read all waiting datagrams; False if there were none."""
        found = False
        while self._socket is not None:
            try:
                data, ancillary, _, sender = _receive(self._socket)
            except BlockingIOError:
                break
            except _GONE:  # the peer's port is closed, most likely not started yet
                continue
            except OSError as error:
                self._lost(error)
                break
            found = True
            self.frame_age_ns = _age_ns(stamp_ns(ancillary))
            if self.address.kind == "udpin":
                self._remember(sender[:2])
            self._parser.reset()  # a frame never spans two datagrams
            self._take(data)
        return found

    def _lost(self, error: OSError) -> None:
        """Reopen the socket after the network was lost."""
        log.warning("link lost; reconnecting", address=str(self.address), reason=str(error))
        self._release()
        self._retry_later()

    def _retry_later(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(RETRY_S, self._reopen)

    def _reopen(self) -> None:
        self._timer = None
        if not self._closed:
            self._reconnects += 1
            self._reopening = asyncio.get_running_loop().create_task(self._try_open())

    async def _try_open(self) -> None:
        try:
            await self.open()
        except LinkError as error:
            log.warning("the link is still down; it is tried again", reason=str(error))
            self._retry_later()

    def _remember(self, peer: tuple[str, int]) -> None:
        now = monotonic_s()
        self._peers[peer] = now
        if len(self._peers) > 1:
            silent = [p for p, heard in self._peers.items() if now - heard > PEER_SILENCE_S]
            for old in silent:
                del self._peers[old]
        if len(self._peers) > MAX_PEERS:  # those known longest stay, the autopilot among them
            del self._peers[list(self._peers)[-2]]

    def _write(self, frame: bytes) -> bool:
        opened = self._socket
        if opened is None:
            return False
        places = (None,) if self.address.kind == "udpout" else tuple(self._peers)
        sent = False
        for place in places:
            try:
                if place is None:
                    opened.send(frame)
                else:
                    opened.sendto(frame, place)
            except _GONE:
                sent = True  # refused is the answer to an earlier frame
            except OSError:
                continue
            else:
                sent = True
        return sent


def _receive(
    opened: socket.socket,
) -> tuple[bytes, list[tuple[int, int, bytes]], int, tuple[str, int]]:
    if hasattr(opened, "recvmsg"):
        return opened.recvmsg(DATAGRAM, 64)
    data, sender = opened.recvfrom(DATAGRAM)
    return data, [], 0, sender


def stamp_ns(ancillary: list[tuple[int, int, bytes]]) -> int | None:
    """Time of a datagram's arrival by the kernel [ns, the computer's UTC]; None without it."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIMESPEC.unpack(data[: _TIMESPEC.size])
            return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)
    return None


def _age_ns(arrived_ns: int | None) -> int:
    age_ns = 0 if arrived_ns is None else wall_ns() - arrived_ns
    return age_ns if 0 <= age_ns < OLDEST_NS else 0
