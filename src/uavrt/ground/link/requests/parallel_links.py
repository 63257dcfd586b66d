"""Use several links to a drone at once: radio, Wi-Fi and cable.

Heartbeats are sent on all links, so that the drone learns every link. The drone sends each
pulse on one link. Our messages use the link on which a message of the drone arrived last, in
the given order of preference. Sessions for several drones share the links: each session
receives every frame and selects those of its drone.
"""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial

from uavrt.core.errors import LinkError
from uavrt.core.log import get_logger
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.dialect import MavComponent
from uavrt.link.mavlink.frame import Frame, FrameWriter
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import open_link
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.signing import Signing

log = get_logger()

FRESH_NS = ns_from_s(3.0)
RETRY_S = 3.0
FIRST_SIGNING_LINK_ID = 1

Listener = Callable[[Frame, int], None]
"""Function that is called with each received frame and the index of its link."""


class Links:
    """The links of a ground station.

    `signing`: signs frames, with a different signing link id for each link.
    """

    def __init__(self, own: tuple[int, int], *, signing: Signing | None = None) -> None:
        self._own = own
        self._signing = signing
        self._links: list[Link | None] = []
        self._writers: list[FrameWriter] = []
        self._listeners: list[Listener] = []

    @property
    def count(self) -> int:
        """Number of links, open or not."""
        return len(self._links)

    @property
    def open_ones(self) -> tuple[Link, ...]:
        """The links that are open now."""
        return tuple(link for link in self._links if link is not None)

    def listen(self, listener: Listener) -> None:
        """Register a function that receives every frame."""
        self._listeners.append(listener)

    def leave(self, listener: Listener) -> None:
        """Unregister a function given to `listen`."""
        with suppress(ValueError):
            self._listeners.remove(listener)

    async def open(self, addresses: Sequence[str]) -> list[asyncio.Task[None]]:
        """Open at least one link; return the tasks that keep trying the other links."""
        self._links = [None] * len(addresses)
        self._writers = [self._writer(number) for number in range(len(addresses))]
        failed: dict[int, LinkError] = {}
        for number, address in enumerate(addresses):
            try:
                await self._open(number, address)
            except LinkError as error:
                failed[number] = error
        if failed and len(failed) == len(addresses):
            raise failed[0]
        for fault in failed.values():
            log.warning("the link failed; it is tried again", reason=str(fault))
        return [asyncio.create_task(self._keep_trying(n, addresses[n])) for n in failed]

    async def close(self) -> None:
        """Close all links to the drones."""
        links, self._links = self.open_ones, [None] * len(self._links)
        for link in links:
            await link.close()

    def write(self, message: Message, number: int) -> None:
        """Send a message on one link; does nothing while that link is closed."""
        link = self._links[number] if number < len(self._links) else None
        if link is not None:
            link.send(self._writers[number].encode(message))

    def _writer(self, number: int) -> FrameWriter:
        if self._signing is None:
            return FrameWriter(*self._own)
        link_id = FIRST_SIGNING_LINK_ID + number
        return FrameWriter(*self._own, partial(self._signing.signature, link_id=link_id))

    async def _open(self, number: int, address: str) -> None:
        self._links[number] = await open_link(
            address, lambda frame: self._receive(frame, number)
        )

    async def _keep_trying(self, number: int, address: str) -> None:
        while self._links[number] is None:
            await asyncio.sleep(RETRY_S)
            with suppress(LinkError):
                await self._open(number, address)

    def _receive(self, frame: Frame, number: int) -> None:
        """Pass a frame to all listeners; an error in one does not stop the others."""
        with ExitStack() as stack:
            for listener in reversed(self._listeners):
                stack.callback(listener, frame, number)


class DroneLinks:
    """The links to one drone.

    `links`: links shared with other drones; None: links of its own.
    """

    def __init__(
        self,
        own: tuple[int, int],
        receive: Listener,
        clock_ns: Callable[[], int],
        *,
        signing: Signing | None = None,
        links: Links | None = None,
    ) -> None:
        self._shared = Links(own, signing=signing) if links is None else links
        self._take = receive
        self._clock_ns = clock_ns
        self._drone_heard_ns: dict[int, int] = {}
        self._pulses_by = 0
        self._joined = False
        self._autopilots: dict[int, tuple[int, int]] = {}
        """For each system id: index of the link whose autopilot frames are used, and time of
        the last [ns]."""

    @property
    def links(self) -> tuple[Link, ...]:
        """The open links; empty before `open`."""
        return self._shared.open_ones if self._joined else ()

    async def open(self, addresses: Sequence[str]) -> list[asyncio.Task[None]]:
        """Open all links, or use another session's; return the tasks that retry failed ones."""
        self._shared.listen(self._receive)
        opening = await self._shared.open(addresses) if addresses else []
        self._joined = True
        return opening

    async def close(self, *, opened: bool = True) -> None:
        """Stop using the links; close them too if this session has opened them (`opened`)."""
        self._shared.leave(self._receive)
        if opened:
            await self._shared.close()

    def send(self, message: Message, link: int | None = None) -> None:
        """Send a message on the link with this index; None selects the best link."""
        number = self.best()[0] if link is None else link
        if getattr(message, "target_component", 0) == MavComponent.COMP_ID_AUTOPILOT1:
            system_id = getattr(message, "target_system", 0)
            number, _ = self._autopilots.get(system_id, (0, 0))
        self._shared.write(message, number)

    def send_by_all(self, message: Message) -> None:
        """Send a message on every link."""
        for number in range(self._shared.count):
            self._shared.write(message, number)

    def best(self) -> list[int]:
        """Indices of the links in the order to try them: those with the drone first."""
        now_ns = self._clock_ns()
        return sorted(
            range(max(1, self._shared.count)),
            key=lambda number: not self._fresh(self._drone_heard_ns.get(number), now_ns),
        )

    def alive(self) -> list[int]:
        """Indices of the links on which the drone's messages arrive."""
        now_ns = self._clock_ns()
        return [n for n, ns in sorted(self._drone_heard_ns.items()) if self._fresh(ns, now_ns)]

    def answer(self, message: Message) -> None:
        """Send a message on the link that carries pulses; if it is silent, on the best link."""
        fresh = self._fresh(self._drone_heard_ns.get(self._pulses_by), self._clock_ns())
        self.send(message, self._pulses_by if fresh else None)

    def drone_received(self, link: int, *, pulse: bool) -> None:
        """Record on which link the drone's message arrived; `pulse`: it held a pulse."""
        self._drone_heard_ns[link] = self._clock_ns()
        if pulse:
            self._pulses_by = link

    def _receive(self, frame: Frame, number: int) -> None:
        """Handle a frame; an autopilot's frames are used from one link, without duplicates."""
        if frame.component_id == MavComponent.COMP_ID_AUTOPILOT1 and self._shared.count > 1:
            now_ns = self._clock_ns()
            on, heard_ns = self._autopilots.get(frame.system_id, (number, now_ns))
            if number != on and self._fresh(heard_ns, now_ns):
                return
            self._autopilots[frame.system_id] = number, now_ns
        self._take(frame, number)

    @staticmethod
    def _fresh(heard_ns: int | None, now_ns: int) -> bool:
        return heard_ns is not None and now_ns - heard_ns < FRESH_NS
