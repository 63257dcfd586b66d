"""Receive UDP datagrams with the kernel's arrival times.

The simulated autopilot's queue empties within milliseconds. On a busy computer this program may
wake up later. So the arrival time of a datagram is used, and not the time at which it is read.
"""

import asyncio
import socket
from collections.abc import Callable

from uavrt.core.clock import Clock
from uavrt.core.errors import LinkError
from uavrt.link.mavlink.links.udp import SO_TIMESTAMPNS, stamp_ns

RECEIVE_BUFFER = 1 << 20


class DatagramPort:
    """UDP socket for the exchange of datagrams with one peer.

    `peer`: host and port to send to; a datagram from another port changes them. `local_port`:
    port on the loopback interface; 0 lets the system choose. `on_datagram`: called with the
    bytes and their arrival time [ns, UTC].
    """

    def __init__(
        self,
        peer: tuple[str, int],
        local_port: int,
        on_datagram: Callable[[bytes, int], None],
        clock: Clock,
    ) -> None:
        self._peer = peer
        self._local_port = local_port
        self._on_datagram = on_datagram
        self._clock = clock
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Bind the socket and watch it from the running loop; raises `LinkError`."""
        family = socket.AF_INET6 if ":" in self._peer[0] else socket.AF_INET
        loopback = self._peer[0] in ("localhost", "::1") or self._peer[0].startswith("127.")
        host = {True: "127.0.0.1", False: ""}[loopback and family == socket.AF_INET]
        opened = socket.socket(family, socket.SOCK_DGRAM)
        try:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            opened.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            opened.bind((host, self._local_port))
        except OSError as error:
            opened.close()
            raise LinkError(
                f"cannot open UDP port {self._local_port}: {error.strerror}",
                remedy="Stop the program that uses it, or choose another port",
            ) from error
        opened.setblocking(False)
        self._socket = opened
        asyncio.get_running_loop().add_reader(opened, self._readable)

    @property
    def port(self) -> int:
        """Port the socket is bound to."""
        assert self._socket is not None
        number: int = self._socket.getsockname()[1]
        return number

    def send(self, data: bytes) -> None:
        """Send a datagram; a missing receiver is not an error."""
        if self._socket is None:
            return
        try:
            self._socket.sendto(data, self._peer)
        except (BlockingIOError, ConnectionRefusedError):
            return

    def close(self) -> None:
        """Close the UDP socket."""
        if self._socket is not None:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()
            self._socket = None

    def _readable(self) -> None:
        assert self._socket is not None
        while self._socket is not None:
            try:
                data, ancillary, _, sender = self._socket.recvmsg(2048, 64)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                continue
            self._peer = sender
            self._on_datagram(data, self._arrival_ns(ancillary))

    def _arrival_ns(self, ancillary: list[tuple[int, int, bytes]]) -> int:
        """Arrival time on this program's clock [ns, UTC], from the kernel's wall time."""
        wall_ns = stamp_ns(ancillary)
        now_ns, correction_ns = self._clock.now_ns(), self._clock.wall_correction_ns()
        return now_ns if wall_ns is None else wall_ns - correction_ns
