"""Serve the page: session and web server together, and a flight that starts by itself.

``uavrt ground`` and ``uavrt demo`` call this; it needs the extra ``uavrt[ground]``.
"""

import asyncio
import contextlib
import gc
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uavrt.clock import Clock, monotonic_s
from uavrt.errors import CommandRefused, ConfigError, LinkError
from uavrt.ground.fleet import Fleet
from uavrt.ground.link import NO_KEYS, GroundEvent, LinkKeys
from uavrt.ground.session import ESSENTIAL, GroundSession
from uavrt.ground.store import GroundStore
from uavrt.ground.web.password_tries import LEAST_PASSWORD
from uavrt.ground.web.server import PageServer, ServerSettings, listening_socket, page_server
from uavrt.heap import HeapKeeper
from uavrt.messages import PulsePose, Tag
from uavrt.recording import ended as queries_ended
from uavrt.recording import pulse_record

RETRY_S = 2.0
QUIET_S = 1.0
STOP_TIMEOUT_S = 12.0
TIDY_S = 5.0
"""A flight of 100 000 pulses that is opened passes through 40 MB, which glibc would keep."""

SLOW_S = 0.03
"""A pulse that comes in the meantime is shown so much later."""
MOST_FREEZES = 8
"""What is frozen is never looked at again, were it garbage then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSettings:
    """What ``uavrt ground`` was asked for."""

    directory: Path
    address: str | None = None
    """None: the one of the last time."""
    my_place: str | None = None
    """Of a GPS receiver; None: that of the last time."""
    dem: str | None = None
    """Elevation files; None: those of the last time."""
    archive: str | None = None
    """What `uavrt batch` wrote; None: that of the last time."""
    tags: tuple[Tag, ...] | None = None
    start: bool = False
    further_vehicles: tuple[int, ...] = ()
    """System numbers of vehicles to serve besides the first, as those of the last time are."""
    keys: LinkKeys = NO_KEYS
    server: ServerSettings = field(default_factory=ServerSettings)


class PageStation:
    """The ground station with its page.

    Parameters
    ----------
    settings : PageSettings
        What to do.
    show : callable
        Called with a dictionary for each event: ``event`` names it.
    """

    def __init__(self, settings: PageSettings, show: Callable[[dict[str, Any]], None]) -> None:
        self._settings = settings
        self._show = show
        self._stopping = asyncio.Event()
        self._started: set[GroundSession] = set()
        store = GroundStore(settings.directory)
        for name in ("address", "my_place", "dem", "archive"):
            if (value := getattr(settings, name)) is not None:
                store.set_settings(store.settings.changed({name: value}))
        if settings.tags is not None:
            store.set_tags(settings.tags)
        self.fleet = Fleet(store, Clock.start(), self._take, settings.keys)
        self.session = self.fleet.first

    def stop(self) -> None:
        """Stop detection if it was started by itself, take the last pulses in, end."""
        self._stopping.set()

    async def run(self) -> None:
        """Serve until `stop`.

        Raises
        ------
        LinkError
            The page's port is in use; or the link that was asked for cannot be opened.
        """
        settings = self._settings.server
        if settings.host not in ("127.0.0.1", "::1", "localhost") and not settings.password:
            raise ConfigError(
                f"the page would be open to everyone who can reach {settings.host}",
                remedy="Set a password in the environment variable UAVRT_GROUND_PASSWORD",
            )
        if settings.password and len(settings.password) < LEAST_PASSWORD:
            raise ConfigError(
                f"the page's password has {len(settings.password)} characters, too few",
                remedy=f"Set {LEAST_PASSWORD} random letters and digits or more in "
                "UAVRT_GROUND_PASSWORD",
            )
        sock = listening_socket(settings)
        server = page_server(self.fleet, settings)
        session = asyncio.create_task(self.fleet.run())
        for number in self._settings.further_vehicles:
            self.fleet.serve(number)
        serving = asyncio.create_task(server.serve(sockets=[sock]))
        work = asyncio.create_task(self._work(sock))
        tidying = asyncio.create_task(_tidied())
        try:
            await asyncio.wait({session, serving, work}, return_when=asyncio.FIRST_COMPLETED)
            for task in (session, serving, work):
                if task.done():
                    task.result()
        finally:
            queries_ended.set()
            tidying.cancel()
            gc.unfreeze()  # libraries look for what they left behind
            work.cancel()
            session.cancel()
            with contextlib.suppress(asyncio.CancelledError, LinkError):
                await session
            await _ended(server, serving)
            sock.close()
            queries_ended.clear()  # for whoever goes on in this program

    async def _work(self, sock: socket.socket) -> None:
        if self._settings.address is not None:
            await self._link_opened()
        self._show({"event": "page", "address": page_address(self._settings.server, sock)})
        if self._settings.start:
            await asyncio.gather(*(self._begin(one) for one in self.fleet.sessions))
        await self._stopping.wait()
        await asyncio.gather(*(self._end(one) for one in self._started))

    async def _link_opened(self) -> None:
        """Wait for the link that was asked for by name; without it the page is of no use."""
        while self.session.link is None:
            if self.session.link_error is not None:
                raise LinkError(self.session.link_error)
            await asyncio.sleep(0.02)

    async def _begin(self, session: GroundSession) -> None:
        """Send a vehicle the tags and start it as soon as it is there."""
        said = ""
        while not self._stopping.is_set():
            try:
                link = session.link
                if link is not None:
                    await link.wait_for_drone(RETRY_S)
                    await session.commands.send_tags()
                    directory = await session.commands.start()
                    self._started.add(session)
                    self._show({"event": "started", "directory": directory})
                    return
            except LinkError as error:
                if str(error) != said:
                    said = str(error)
                    self._show({"event": "waiting", "reason": said})
            await asyncio.sleep(RETRY_S / 10)

    async def _end(self, session: GroundSession) -> None:
        """Stop detection; wait until the drone has stopped and no pulse comes any more."""
        with contextlib.suppress(LinkError, CommandRefused):
            if session.state in ESSENTIAL:
                await session.commands.stop()
        deadline_s = monotonic_s() + STOP_TIMEOUT_S
        await asyncio.sleep(QUIET_S)
        while monotonic_s() < deadline_s:
            quiet = monotonic_s() - session.last_pulse_s > QUIET_S
            if session.state not in ESSENTIAL and quiet:
                break
            await asyncio.sleep(0.1)
        self._show({"event": "stopped", "pulses": session.flight.pulses})

    def _take(self, event: GroundEvent) -> None:
        if isinstance(event, PulsePose):
            self._show({"event": "pulse", **pulse_record(event)})


def page_address(settings: ServerSettings, sock: socket.socket) -> str:
    """Write the address that a browser on this computer opens."""
    scheme = "https" if settings.certificate else "http"
    wildcard = settings.host in ("0.0.0.0", "::", "127.0.0.1")
    host = "127.0.0.1" if wildcard else settings.host
    shown = f"[{host}]" if ":" in host else host
    return f"{scheme}://{shown}:{sock.getsockname()[1]}/"


async def _tidied() -> None:
    """Give free memory back from time to time, until cancelled.

    What was imported stays: it is frozen, so that a collection does not look at it each time.
    The first estimate or report imports more; a collection that is slow tells of it.
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
