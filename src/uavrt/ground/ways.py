"""The ground station's links to one drone: radio, Wi-Fi, cable, all at once.

Heartbeats leave by all of them, so that the drone knows them all; it sends each pulse by one,
and what we have to say goes by the one on which it was heard last, in the order given.
"""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial

from uavrt.errors import LinkError
from uavrt.log import get_logger
from uavrt.mavlink.dialect import MavComponent
from uavrt.mavlink.frame import Frame, FrameWriter
from uavrt.mavlink.link import Link
from uavrt.mavlink.message import Message
from uavrt.mavlink.signing import Signing
from uavrt.mavlink.transport import open_link
from uavrt.units import ns_from_s

log = get_logger()

FRESH_NS = ns_from_s(3.0)
RETRY_S = 3.0
FIRST_SIGNING_LINK_ID = 1


class Ways:
    """All links of a ground station.

    Parameters
    ----------
    own : (int, int)
        System and component id.
    receive : callable
        Gets each frame and the number of its link.
    clock_ns : callable
        Time now [ns].
    signing : Signing, optional
        Signs what leaves, with a link id for each link.
    """

    def __init__(
        self,
        own: tuple[int, int],
        receive: Callable[[Frame, int], None],
        clock_ns: Callable[[], int],
        *,
        signing: Signing | None = None,
    ) -> None:
        self._own = own
        self._signing = signing
        self._take = receive
        self._clock_ns = clock_ns
        self._links: list[Link | None] = []
        self._writers: list[FrameWriter] = []
        self._drone_heard_ns: dict[int, int] = {}
        self._pulses_by = 0
        self._autopilot_on = 0
        self._autopilot_heard_ns: int | None = None

    @property
    def links(self) -> tuple[Link, ...]:
        """Those that are open."""
        return tuple(link for link in self._links if link is not None)

    async def open(self, addresses: Sequence[str]) -> list[asyncio.Task[None]]:
        """Open all; give the tasks that go on trying where that was not possible.

        Raises
        ------
        ConfigError
            An address is none.
        LinkError
            None could be opened.
        """
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
            log.warning("link fault", reason=str(fault))
        return [asyncio.create_task(self._keep_trying(n, addresses[n])) for n in failed]

    async def close(self) -> None:
        """Close all."""
        for link in self.links:
            await link.close()

    def send(self, message: Message, link: int | None = None) -> None:
        """Send by one link, the best one unless told."""
        number = self.best()[0] if link is None else link
        if getattr(message, "target_component", 0) == MavComponent.COMP_ID_AUTOPILOT1:
            number = self._autopilot_on
        self._write(message, number)

    def send_by_all(self, message: Message) -> None:
        """Send by every link."""
        for number in range(len(self._links)):
            self._write(message, number)

    def best(self) -> list[int]:
        """Links in the order in which to try them: where the drone is heard, as given."""
        now_ns = self._clock_ns()
        return sorted(
            range(max(1, len(self._links))),
            key=lambda number: not self._fresh(self._drone_heard_ns.get(number), now_ns),
        )

    def alive(self) -> list[int]:
        """Links on which the drone is heard."""
        now_ns = self._clock_ns()
        return [n for n, ns in sorted(self._drone_heard_ns.items()) if self._fresh(ns, now_ns)]

    def answer(self, message: Message) -> None:
        """Send by the link that the drone uses for pulses, if it has used one lately."""
        fresh = self._fresh(self._drone_heard_ns.get(self._pulses_by), self._clock_ns())
        self.send(message, self._pulses_by if fresh else None)

    def heard_drone(self, link: int, *, pulse: bool) -> None:
        """The drone is heard by that link; it chose it, if with something for all."""
        self._drone_heard_ns[link] = self._clock_ns()
        if pulse:
            self._pulses_by = link

    def _writer(self, number: int) -> FrameWriter:
        if self._signing is None:
            return FrameWriter(*self._own)
        link_id = FIRST_SIGNING_LINK_ID + number
        return FrameWriter(*self._own, partial(self._signing.signature, link_id=link_id))

    async def _open(self, number: int, address: str) -> None:
        self._links[number] = await open_link(address, lambda frame: self._hear(frame, number))

    async def _keep_trying(self, number: int, address: str) -> None:
        while self._links[number] is None:
            await asyncio.sleep(RETRY_S)
            with suppress(LinkError):
                await self._open(number, address)

    def _hear(self, frame: Frame, number: int) -> None:
        """Take a frame; the autopilot's by one link only, for its numbers are one series."""
        if frame.component_id == MavComponent.COMP_ID_AUTOPILOT1 and len(self._links) > 1:
            now_ns = self._clock_ns()
            if number != self._autopilot_on and self._fresh(self._autopilot_heard_ns, now_ns):
                return
            self._autopilot_on, self._autopilot_heard_ns = number, now_ns
        self._take(frame, number)

    def _write(self, message: Message, number: int) -> None:
        link = self._links[number] if number < len(self._links) else None
        if link is not None:
            link.send(self._writers[number].encode(message))

    @staticmethod
    def _fresh(heard_ns: int | None, now_ns: int) -> bool:
        return heard_ns is not None and now_ns - heard_ns < FRESH_NS
