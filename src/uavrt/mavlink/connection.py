"""A component on a link: what the connection process runs.

The link moves bytes, `Component` knows the protocol, `PacedQueue` knows when; this joins them
on an asyncio loop and knows nothing else.
"""

import asyncio
from collections.abc import Callable

from uavrt.errors import TunnelError
from uavrt.log import get_logger
from uavrt.mavlink.address import Address
from uavrt.mavlink.component import Component, Handlers
from uavrt.mavlink.dialect import Tunnel
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.frame import Frame, FrameWriter
from uavrt.mavlink.link import Link
from uavrt.mavlink.message import Message
from uavrt.mavlink.pacing import Item, PacedQueue, Priority, Source, Tunnelled
from uavrt.mavlink.rate import LinkRate
from uavrt.mavlink.statustext import chunks_of
from uavrt.mavlink.transport import open_link
from uavrt.units import NANOSECONDS_PER_SECOND

log = get_logger()

TICK_S = 0.05
TUNNEL_SIZE = 128


class TunnelSender:
    """Sends messages for the ground one at a time, a gap apart.

    Parameters
    ----------
    send : callable
        Sends a message now.
    target : callable
        Gives the address of all ground stations, or None while there is none; pulses and
        status wait for it.
    clock_ns : callable
        Time now [ns].
    gap_s : float
        Time between two messages, at least 0.012 s.
    """

    def __init__(
        self,
        send: Callable[[Message], None],
        target: Callable[[], Peer | None],
        clock_ns: Callable[[], int],
        *,
        gap_s: float = 0.020,
    ) -> None:
        self._send = send
        self._target = target
        self._clock_ns = clock_ns
        self._queue = PacedQueue(gap_s)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._text_id = 0

    @property
    def rate(self) -> LinkRate:
        """What the way to the ground takes."""
        return self._queue.rate

    def add_source(self, source: Source, priority: Priority) -> None:
        """Take messages of that priority from `source`; call `wake` when it has new ones."""
        self._queue.add_source(source, priority)

    def send_tunnel(
        self,
        payload: bytes,
        priority: Priority,
        target: Peer | None = None,
        payload_type: int = 0,
    ) -> None:
        """Queue a tunnel payload; without a target it goes to all ground stations.

        Raises
        ------
        TunnelError
            It is longer than 128 bytes.
        """
        if len(payload) > TUNNEL_SIZE:
            raise TunnelError(f"a payload has at most 128 bytes, not {len(payload)}", payload)
        self._put(Tunnelled(payload, target, payload_type), priority)

    def send_message(self, message: Message, priority: Priority = Priority.STATUS) -> None:
        """Queue any message for the ground."""
        self._put(message, priority)

    def send_text(self, severity: int, text: str) -> None:
        """Queue a text for the operators, in as many pieces as it needs."""
        self._text_id = self._text_id % 65_535 + 1
        for chunk in chunks_of(text, severity, self._text_id):
            self._put(chunk, Priority.STATUS)

    def counters(self) -> dict[str, float]:
        """Counts with names for a health record."""
        counters = self._queue.counters
        return {
            "tunnel_waiting": len(self._queue),
            "tunnel_sent": counters.released,
            "link_rate_bytes_s": round(self.rate.bytes_s(self._clock_ns())),
            **{
                f"tunnel_dropped_{priority.name.lower()}": count
                for priority, count in counters.dropped.items()
            },
        }

    async def run(self) -> None:
        """Send for ever."""
        self._loop = asyncio.get_running_loop()
        try:
            self._pump()
            await self._loop.create_future()
        finally:
            self._loop = None
            self._cancel_timer()

    def wake(self) -> None:
        """Look again: a source has something, or may send sooner."""
        if self._loop is not None:
            self._pump()

    def _pump(self) -> None:
        """Send what may go now; come back when the next may.

        By timers of the loop and not by a task: at 200 messages a second a task's wake-ups
        cost more than the messages.
        """
        self._cancel_timer()
        while (wait_ns := self._queue.wait_ns(now_ns := self._clock_ns())) is not None:
            if wait_ns == 0 and not self._nobody_there():
                item = self._queue.take(now_ns)
                if item is not None:
                    self._send(self._message(item))
                    continue
            assert self._loop is not None
            wait_s = wait_ns / NANOSECONDS_PER_SECOND if wait_ns else TICK_S
            self._timer = self._loop.call_later(wait_s, self._pump)
            return

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _nobody_there(self) -> bool:
        """Tell whether the first urgent message is for all ground stations, and none is there.

        Acknowledgements name their receiver, which need not send heartbeats; sources know
        themselves whom they send to.
        """
        first = self._queue.first()
        if first is None or (isinstance(first, Tunnelled) and first.target is not None):
            return False
        return not getattr(first, "target_system", 0) and self._target() is None

    def _put(self, item: Item, priority: Priority) -> None:
        self._queue.put(item, priority)
        self.wake()

    def _message(self, item: Item) -> Message:
        if isinstance(item, Message):
            return item
        target = item.target or self._target() or Peer(0, 0)
        return Tunnel(
            target_system=target.system_id,
            target_component=target.component_id,
            payload_type=item.payload_type,
            payload_length=len(item.payload),
            payload=item.payload,
        )


class Connection:
    """The drone's MAVLink connection.

    Parameters
    ----------
    handlers : Handlers
        Receivers of samples and tunnel payloads.
    clock_ns : callable
        Our clock [ns, UTC]; every time handed out is on it.
    component_id, attitude_rate_hz, position_rate_hz, gap_s, healthy
        See `Component` and `TunnelSender`.
    """

    def __init__(
        self,
        handlers: Handlers,
        clock_ns: Callable[[], int],
        *,
        component_id: int = 191,
        attitude_rate_hz: float = 50.0,
        position_rate_hz: float = 10.0,
        gap_s: float = 0.020,
        healthy: Callable[[], bool] = lambda: True,
    ) -> None:
        self._clock_ns = clock_ns
        self._link: Link | None = None
        self.component = Component(
            self._send,
            handlers,
            component_id=component_id,
            attitude_rate_hz=attitude_rate_hz,
            position_rate_hz=position_rate_hz,
            healthy=healthy,
        )
        self.tunnel = TunnelSender(
            self._send,
            lambda: self.component.discovery.target(clock_ns()),
            clock_ns,
            gap_s=gap_s,
        )
        self._writer = FrameWriter(self.component.system_id, component_id)

    async def run(self, address: str | Address) -> None:
        """Open the link and serve it until cancelled.

        Raises
        ------
        ConfigError, LinkError
            The link cannot be opened.
        """
        self._link = await open_link(address, self._receive)
        log.info("link open", address=str(self._link.address))
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self.tunnel.run())
                tasks.create_task(self._tick())
        finally:
            await self._link.close()

    @property
    def link(self) -> Link | None:
        """The link, once open."""
        return self._link

    @property
    def station_present(self) -> bool:
        """True while any ground station's heartbeats come."""
        return self.component.discovery.station_present(self._clock_ns())

    @property
    def autopilot_present(self) -> bool:
        """True while the autopilot's heartbeats come."""
        return self.component.discovery.autopilot_present(self._clock_ns())

    def peers(self) -> dict[str, str]:
        """Who is there, for a log line."""
        discovery = self.component.discovery
        stations = discovery.stations(self._clock_ns())
        return {
            "autopilot": str(discovery.autopilot or "none"),
            "ground_stations": ", ".join(map(str, stations)) or "none",
        }

    def status(self) -> str:
        """What is missing, in a word or two."""
        return self.component.status(self._clock_ns())

    def counters(self) -> dict[str, float]:
        """All counts, for a health record."""
        link = {} if self._link is None else self._link.health()
        counters = {name: float(count) for name, count in self.component.counters.items()}
        return {**counters, **link, **self.tunnel.counters()}

    async def _tick(self) -> None:
        while True:
            self.component.tick(self._clock_ns())
            await asyncio.sleep(TICK_S)

    def _receive(self, frame: Frame) -> None:
        age_ns = 0 if self._link is None else self._link.frame_age_ns
        self.component.receive(frame, self._clock_ns() - age_ns)

    def _send(self, message: Message) -> None:
        if self._link is not None:
            self._writer.system_id = self.component.system_id
            self._link.send(self._writer.encode(message))
