"""Run a MAVLink component on the drone's links, on an asyncio loop.

A link transfers bytes, `Component` implements the protocol, and `TunnelSender` chooses the link
and the time of each message. `Connection` joins the three.
"""

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType

from uavrt.config.settings import MavlinkSettings
from uavrt.core.log import get_logger
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.link.mavlink.component import DEFAULTS, Component, Handlers
from uavrt.link.mavlink.dialect import MavComponent
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import SIGNATURE_SIZE, Frame, FrameWriter
from uavrt.link.mavlink.links.address import Address
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import open_link
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.routes import Routes
from uavrt.link.mavlink.sending.sender import TICK_S, PacedSender, TunnelSender
from uavrt.link.mavlink.sending.signing import Signing

log = get_logger()

AUTOPILOT_LINK = 0
COMMAND_WAITS_S = 0.2
"""Longest time that bytes already queued may delay a vehicle command [s]: 1152 bytes at 57 600
baud."""


class _OpenLink:
    """An open link, and the writer that numbers its frames."""

    def __init__(self, number: int, writer: FrameWriter) -> None:
        self.number = number
        self.link: Link | None = None
        self._writer = writer

    def send(self, message: Message, system_id: int) -> None:
        if self.link is not None:
            self._writer.system_id = system_id
            self.link.send(self._writer.encode(message))


class Connection:
    """The drone's MAVLink connection.

    `clock_ns`: clock of all times that are passed on [ns, UTC]. `own_system_id`, `watched_hz`:
    see `Component`. `signing`: signs and checks frames; the number of a link is its signing
    link id.
    """

    def __init__(
        self,
        handlers: Handlers,
        clock_ns: Callable[[], int],
        settings: MavlinkSettings = DEFAULTS,
        *,
        signing: Signing | None = None,
        watched_hz: Mapping[int, float] = MappingProxyType({}),
        own_system_id: int | None = None,
    ) -> None:
        self._clock_ns = clock_ns
        self._signing = signing
        self._receiving: int | None = None
        self.component = Component(
            self._send,
            handlers,
            settings,
            watched_hz=watched_hz,
            own_system_id=own_system_id,
        )
        self._ways = [
            _OpenLink(
                number,
                FrameWriter(
                    self.component.system_id,
                    settings.component_id,
                    None if signing is None else partial(signing.signature, link_id=number),
                ),
            )
            for number in range(1 + len(settings.direct_links))
        ]
        self._routes = Routes(len(self._ways))
        senders = [
            PacedSender(
                lambda message, way=way: way.send(message, self.component.system_id),  # type: ignore[misc]
                lambda: self.component.discovery.target(clock_ns()),
                clock_ns,
                gap_s=settings.tunnel_gap_s,
                straight=way.number != AUTOPILOT_LINK,
                frame_extra_bytes=0 if signing is None else SIGNATURE_SIZE,
                may_send=lambda: self.component.has_number(clock_ns()),
            )
            for way in self._ways
        ]
        self._senders = senders
        self.tunnel = TunnelSender(senders, self._routes, self.component.discovery)

    async def run(self, *addresses: str | Address) -> None:
        """Open all links and serve them until cancelled; raises `ConfigError`, `LinkError`."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.keep_time())
            for number, address in enumerate(addresses):
                tasks.create_task(self.serve(number, address))

    async def serve(self, number: int, address: str | Address) -> None:
        """Serve one link until cancelled, while `keep_time` runs; raises the same errors as
        `run`.
        """
        link = await open_link(address, lambda frame: self._receive(number, frame))
        self._ways[number].link = link
        log.info("link open", address=str(link.address))
        try:
            await self._senders[number].run()
        finally:
            self._ways[number].link = None
            await link.close()

    async def keep_time(self) -> None:
        """Call the component's `tick` about every 50 ms, until cancelled."""
        while True:
            now_ns = self._clock_ns()
            self.component.tick(now_ns)
            self.tunnel.choose(now_ns)
            await asyncio.sleep(TICK_S)

    def command_autopilot(self, message: Message) -> None:
        """Send a command to the autopilot at once or not at all.

        A late command could override a pilot who has taken over in the meantime.
        """
        if self.commands_leave:
            self._ways[AUTOPILOT_LINK].send(message, self.component.system_id)
        else:
            self.component.counters["commands_not_sent"] += 1

    @property
    def commands_leave(self) -> bool:
        """True if a command to the autopilot would be sent without delay."""
        link = self.link
        return link is not None and link.delay_s <= COMMAND_WAITS_S

    @property
    def link(self) -> Link | None:
        """Link number 0, which leads to the autopilot; None until it is open."""
        return self._ways[AUTOPILOT_LINK].link

    @property
    def receiving_link(self) -> int:
        """Number of the link on which the frame now being handled arrived."""
        return self._receiving or AUTOPILOT_LINK

    @property
    def station_present(self) -> bool:
        """True while any ground station's heartbeats arrive."""
        return self.component.discovery.station_present(self._clock_ns())

    @property
    def other_station_present(self) -> bool:
        """True while heartbeats of a ground station other than uavrt's arrive."""
        return self.component.discovery.other_station_present(self._clock_ns())

    @property
    def autopilot_present(self) -> bool:
        """True while the autopilot's heartbeats arrive."""
        return self.component.discovery.autopilot_present(self._clock_ns())

    @property
    def clock_is_stale(self) -> bool:
        """True while TIMESYNC answers are missing, so that the autopilot's clock is
        extrapolated.
        """
        return self.component.clock_is_stale(self._clock_ns())

    @property
    def place(self) -> tuple[int, int]:
        """System and component id of this drone."""
        return self.component.system_id, self.component.component_id

    def stations_silent_s(self) -> dict[tuple[int, int], float]:
        """Time since the last heartbeat of each ground station, by its ids [s]."""
        silent = self.component.discovery.silent_ns(self._clock_ns())
        return {
            peer.place: silent_ns / NANOSECONDS_PER_SECOND for peer, silent_ns in silent.items()
        }

    def peers(self) -> dict[str, str]:
        """Descriptions of the present autopilot and ground stations for a log line."""
        discovery = self.component.discovery
        stations = discovery.stations(self._clock_ns())
        return {
            "autopilot": str(discovery.autopilot or "none"),
            "ground_stations": ", ".join(map(str, stations)) or "none",
        }

    def status(self) -> str:
        """Part of the link that is missing, in one or two words; ``"ready"`` if none is."""
        return self.component.status(self._clock_ns())

    def counters(self) -> dict[str, float]:
        """Counts of all links and of the component, for a health record."""
        counters = {name: float(count) for name, count in self.component.counters.items()}
        if self._signing is not None:
            counters |= self._signing.counters
        for way in self._ways:
            for name, count in ({} if way.link is None else way.link.health()).items():
                own = name if way.number == 0 else name.replace("link_", f"link{way.number}_")
                counters[own] = count
        discovery = self.component.discovery
        if discovery.autopilot_present(self._clock_ns()):
            counters["autopilot_armed"] = float(discovery.autopilot_armed)
            if discovery.autopilot_landed is not None:
                counters["autopilot_landed"] = float(discovery.autopilot_landed)
        clock = self.component.time_sync.counters(self._clock_ns())
        return {**counters, **clock, **self.tunnel.counters()}

    def _receive(self, number: int, frame: Frame) -> None:
        if self._signing is not None and not self._signing.accepts(frame):
            return
        link = self._ways[number].link
        now_ns = self._clock_ns() - (0 if link is None else link.frame_age_ns)
        if len(self._ways) > 1:
            if (
                number != AUTOPILOT_LINK
                and frame.component_id == MavComponent.COMP_ID_AUTOPILOT1
            ):
                # Forwarded by a ground station: late, and so is its clock.
                self.component.counters["autopilot_elsewhere"] += 1
                return
            self._routes.received(Peer(frame.system_id, frame.component_id), number, now_ns)
        self._receiving = number
        try:
            self.component.receive(frame, now_ns, number)
        finally:
            self._receiving = None

    def _send(self, message: Message) -> None:
        """Send an answer on the link on which its request arrived, a heartbeat on all links."""
        system_id = self.component.system_id
        if self._receiving is not None:
            self._ways[self._receiving].send(message, system_id)
        elif getattr(message, "target_system", 0):
            self._ways[AUTOPILOT_LINK].send(message, system_id)
        else:
            for way in self._ways:
                way.send(message, system_id)
