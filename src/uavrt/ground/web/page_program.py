"""Serve the page: the station and its web server together; needs
the extra ``uavrt[ground]``.
"""

import asyncio
import contextlib
import gc
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import ConfigError
from uavrt.core.runtime.heap import HeapKeeper
from uavrt.ground.station import Station, StationSettings
from uavrt.ground.web.access.password_limit import LEAST_PASSWORD
from uavrt.ground.web.server import PageServer, ServerSettings, listening_socket, page_server

TIDY_S = 5.0
"""Interval of returning free memory to the system [s]. Opening a flight of 100 000 pulses uses
40 MB, which glibc would keep."""

SLOW_S = 0.03
"""Duration above which a garbage collection visibly delays a pulse on the page [s]."""
MOST_FREEZES = 8
"""Maximum number of times that all present objects are exempted from garbage collection.
Exempted objects are never freed, even if they are no longer used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSettings(StationSettings):
    """Options of ``uavrt ground`` that concern the page."""

    server: ServerSettings = field(default_factory=ServerSettings)


class PageStation(Station):
    """The ground station together with its page's server."""

    def __init__(self, settings: PageSettings, show: Callable[[dict[str, Any]], None]) -> None:
        super().__init__(settings, show)
        self._served = settings.server

    async def run(self) -> None:
        """Serve the vehicles and the page until `stop`; raises `LinkError`."""
        settings = self._served
        if settings.host not in ("127.0.0.1", "::1", "localhost") and not settings.password:
            raise ConfigError(
                f"the page would be open to everyone who can reach {settings.host}",
                remedy="Set a password in the environment variable UAVRT_GROUND_PASSWORD",
            )
        if settings.password and len(settings.password) < LEAST_PASSWORD:
            raise ConfigError(
                f"the page's password is too short: it has {len(settings.password)} characters",
                remedy=f"Set at least {LEAST_PASSWORD} random letters and digits in "
                "UAVRT_GROUND_PASSWORD",
            )
        sock = listening_socket(settings)
        server = page_server(self.fleet, settings)
        serving = asyncio.create_task(server.serve(sockets=[sock]))
        tidying = asyncio.create_task(_tidied())
        try:
            await self._serve(self._work(page=page_address(settings, sock)), serving)
        finally:
            tidying.cancel()
            gc.unfreeze()  # libraries look for what they left behind
            await _ended(server, serving)
            sock.close()


def page_address(settings: ServerSettings, sock: socket.socket) -> str:
    """URL of the page for a browser on this computer."""
    scheme = "https" if settings.certificate else "http"
    wildcard = settings.host in ("0.0.0.0", "::", "127.0.0.1")
    host = "127.0.0.1" if wildcard else settings.host
    shown = f"[{host}]" if ":" in host else host
    return f"{scheme}://{shown}:{sock.getsockname()[1]}/"


async def _tidied() -> None:
    """Free unused memory periodically, until cancelled; imported modules are exempted.

    The first estimate or report imports more modules. If a collection is then slow, these are
    exempted too.
    """
    gc.freeze()
    heap, freezes = HeapKeeper(monotonic_s(), period_s=TIDY_S), 1
    while True:
        await asyncio.sleep(TIDY_S / 5)
        begun_s = monotonic_s()
        kept = heap.keep(begun_s)
        if kept and monotonic_s() - begun_s > SLOW_S and freezes < MOST_FREEZES:
            gc.freeze()
            freezes += 1


async def _ended(server: PageServer, serving: "asyncio.Task[None]") -> None:
    server.should_exit = True
    with contextlib.suppress(asyncio.CancelledError, TimeoutError):
        async with asyncio.timeout(5.0):
            await serving
