"""Limit open connections to the page: per client, and those without a request.

The page shares its process with the drone's link and the flight's files, so connections may use
only a part of the file descriptors, and each client only some of that. A connection without a
complete request is closed within seconds. If a client has too many, its oldest idle one is
closed for its newest.
"""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from uavrt.clock import monotonic_s

MOST_CONNECTIONS = 256
MOST_BY_CLIENT = 64
"""Most connections per client; a browser keeps some ten open for each page."""
SILENT_S = 10.0
"""Time after which a connection without a complete request is closed [s]."""
_SHARE_OF_FILES = 4
"""Connections may use one in this many file descriptors; link and flight have the others."""
_AT_ONCE = 16
"""Most connections accepted per turn of the event loop."""

Peer = tuple[str, int]


@dataclass(slots=True, eq=False)
class _Connection:
    """An open connection."""

    socket: socket.socket
    since_s: float = field(default_factory=monotonic_s)
    has_asked: bool = False


class _Counted(socket.socket):
    """A connection's socket that reports when it is closed."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.on_close: Any = None

    def close(self) -> None:
        """Close it."""
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
        """Connections that were closed at once or to make room for others."""

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept the next connection within the limits; raises `BlockingIOError`."""
        self._taken += 1
        try:
            if self._taken > _AT_ONCE:
                raise BlockingIOError
            plain, address = super().accept()
        except BlockingIOError:
            self._taken = 0
            raise
        taken = _Counted(plain.family, plain.type, plain.proto, fileno=plain.detach())
        peer = (str(address[0]), int(address[1]))
        if not self._make_room(peer[0]):
            self.refused += 1
            taken.close()
            return self.accept()
        self._open[peer] = one = _Connection(taken)
        taken.on_close = lambda: self._forget(peer, one)
        return taken, address

    def asked(self, peer: Peer) -> None:
        """Record that a complete request has arrived."""
        if (one := self._open.get(peer)) is not None:
            one.has_asked = True

    def close_silent(self) -> None:
        """Close connections without a request in time, including incomplete TLS handshakes."""
        before_s = monotonic_s() - SILENT_S
        for peer, one in list(self._open.items()):
            if not one.has_asked and one.since_s < before_s:
                self._end(peer, one)

    def _make_room(self, host: str) -> bool:
        """True if a client may open one more, perhaps by closing an idle one."""
        of_client = [item for item in self._open.items() if item[0][0] == host]
        if len(of_client) >= MOST_BY_CLIENT:
            return self._end_oldest(of_client)
        return len(self._open) < self.most or self._end_oldest(list(self._open.items()))

    def _end_oldest(self, some: list[tuple[Peer, _Connection]]) -> bool:
        for peer, one in some:  # in the order in which they came
            if not one.has_asked:
                self._end(peer, one)
                return True
        return False

    def _end(self, peer: Peer, one: _Connection) -> None:
        """Shut a connection; the event loop then closes it."""
        self.refused += 1
        self._forget(peer, one)
        with contextlib.suppress(OSError):
            one.socket.shutdown(socket.SHUT_RDWR)

    def _forget(self, peer: Peer, one: _Connection) -> None:
        if self._open.get(peer) is one:
            del self._open[peer]


class AskingProtocol(H11Protocol):
    """HTTP that reports to its listening socket which connections have made a request."""

    doors: ListeningSocket | None = None

    def handle_events(self) -> None:
        """Handle received data, as uvicorn does."""
        super().handle_events()
        if self.cycle is not None:
            self._asked()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Handle a WebSocket upgrade, as uvicorn does."""
        self._asked()
        super().handle_websocket_upgrade(event)

    def _asked(self) -> None:
        if self.doors is not None and self.client is not None:
            self.doors.asked(self.client)


def protocol_of(doors: ListeningSocket) -> type[AskingProtocol]:
    """Make the protocol of a listening socket's connections."""
    return type("AskingProtocol", (AskingProtocol,), {"doors": doors})


@contextlib.contextmanager
def doors_watched(doors: ListeningSocket) -> Iterator[None]:
    """Close silent connections within this context, and reserve descriptors for the rest."""
    doors.most = min(MOST_CONNECTIONS, max(8, _descriptors() // _SHARE_OF_FILES))
    watching = asyncio.get_running_loop().create_task(_watch(doors))
    try:
        yield
    finally:
        watching.cancel()


async def _watch(doors: ListeningSocket) -> None:
    while True:
        await asyncio.sleep(SILENT_S / 5.0)
        doors.close_silent()


def _descriptors() -> int:
    """Number of descriptors for this process, raised to the system's limit."""
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
