"""Limit the page's open connections: per client, and those without a request.

The page shares file descriptors with the drone's link and the flight's files. A connection
without a complete request is closed within seconds; a new one beyond a client's limit closes
its oldest idle one.
"""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from uavrt.core.clock import monotonic_s

MOST_CONNECTIONS = 256
MOST_BY_CLIENT = 64
"""Maximum number of connections of one client; a browser keeps some ten open per page."""
SILENT_S = 10.0
"""Time after which a connection without a complete request is closed [s]."""
_SHARE_OF_FILES = 4
"""Divisor of the number of file descriptors: connections may use a quarter of them, so that
link and flight files always get some."""
_AT_ONCE = 16
"""Maximum number of connections accepted in one turn of the event loop."""

Peer = tuple[str, int]


@dataclass(slots=True, eq=False)
class _Connection:
    """One client's open connection to the page's server."""

    socket: socket.socket
    since_s: float = field(default_factory=monotonic_s)
    has_request: bool = False


class _ReportingSocket(socket.socket):
    """Socket that calls `on_close` when it is closed."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.on_close: Any = None

    def close(self) -> None:
        """Close the socket, and report that once."""
        super().close()
        done, self.on_close = self.on_close, None
        if done is not None:
            done()


class ListeningSocket(socket.socket):
    """A listening socket that limits its connections."""

    def __init__(self, family: int) -> None:
        super().__init__(family, socket.SOCK_STREAM)
        self._open: dict[Peer, _Connection] = {}
        self._taken = 0
        self.most = MOST_CONNECTIONS
        self.refused = 0
        """Number of connections closed at once because too many were open."""

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept the next connection within the limits; raises `BlockingIOError` if none."""
        self._taken += 1
        try:
            if self._taken > _AT_ONCE:
                raise BlockingIOError
            plain, address = super().accept()
        except BlockingIOError:
            self._taken = 0
            raise
        taken = _ReportingSocket(plain.family, plain.type, plain.proto, fileno=plain.detach())
        peer = (str(address[0]), int(address[1]))
        if not self._make_room(peer[0]):
            self.refused += 1
            taken.close()
            return self.accept()
        self._open[peer] = one = _Connection(taken)
        taken.on_close = lambda: self._forget(peer, one)
        return taken, address

    def request_received(self, peer: Peer) -> None:
        """Record that a client's connection has sent a complete request."""
        if (one := self._open.get(peer)) is not None:
            one.has_request = True

    def close_silent(self) -> None:
        """Close connections whose request or TLS handshake is not complete in time."""
        before_s = monotonic_s() - SILENT_S
        for peer, one in list(self._open.items()):
            if not one.has_request and one.since_s < before_s:
                self._end(peer, one)

    def _make_room(self, host: str) -> bool:
        """True if a client may open another connection; an idle one may be closed for it."""
        of_client = [item for item in self._open.items() if item[0][0] == host]
        if len(of_client) >= MOST_BY_CLIENT:
            return self._end_oldest(of_client)
        return len(self._open) < self.most or self._end_oldest(list(self._open.items()))

    def _end_oldest(self, some: list[tuple[Peer, _Connection]]) -> bool:
        for peer, one in some:  # in the order in which they came
            if not one.has_request:
                self._end(peer, one)
                return True
        return False

    def _end(self, peer: Peer, one: _Connection) -> None:
        """Shut a connection down; the event loop then closes it."""
        self.refused += 1
        self._forget(peer, one)
        with contextlib.suppress(OSError):
            one.socket.shutdown(socket.SHUT_RDWR)

    def _forget(self, peer: Peer, one: _Connection) -> None:
        if self._open.get(peer) is one:
            del self._open[peer]


class LimitedProtocol(H11Protocol):
    """HTTP protocol that reports complete requests to its listening socket."""

    listening: ListeningSocket | None = None

    def handle_events(self) -> None:
        """Handle received data as uvicorn does, and report complete requests."""
        super().handle_events()
        if self.cycle is not None:
            self._asked()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Handle a WebSocket upgrade as uvicorn does, and report the request."""
        self._asked()
        super().handle_websocket_upgrade(event)

    def _asked(self) -> None:
        if self.listening is not None and self.client is not None:
            self.listening.request_received(self.client)


def limited_protocol(listening: ListeningSocket) -> type[LimitedProtocol]:
    """Make the protocol class for the connections of a listening socket."""
    return type("LimitedProtocol", (LimitedProtocol,), {"listening": listening})


@contextlib.contextmanager
def connections_limited(listening: ListeningSocket) -> Iterator[None]:
    """Context that closes silent connections and limits descriptors used by connections."""
    listening.most = min(MOST_CONNECTIONS, max(8, _descriptors() // _SHARE_OF_FILES))
    watching = asyncio.get_running_loop().create_task(_watch(listening))
    try:
        yield
    finally:
        watching.cancel()


async def _watch(listening: ListeningSocket) -> None:
    while True:
        await asyncio.sleep(SILENT_S / 5.0)
        listening.close_silent()


def _descriptors() -> int:
    """Raise this process's limit of file descriptors to the system's; return it."""
    try:
        import resource
    except ImportError:  # Windows
        return MOST_CONNECTIONS * _SHARE_OF_FILES
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 4096 if hard == resource.RLIM_INFINITY else min(hard, 4096)
    if soft < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    return soft
