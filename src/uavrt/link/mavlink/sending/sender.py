"""Send messages to the ground: choose the link and the time.

`PacedSender` sends over one link; `TunnelSender` has one for each link and chooses.
"""

import asyncio
from collections import deque
from collections.abc import Callable

from uavrt.core.errors import TunnelError
from uavrt.core.log import get_logger
from uavrt.core.messages import TunnelPayload
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.link.mavlink.dialect import Tunnel
from uavrt.link.mavlink.discovery import Discovery, Peer
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.pacing import (
    DIRECT_LINK_GAP_S,
    Item,
    PacedQueue,
    Priority,
    Source,
)
from uavrt.link.mavlink.sending.rate import DIRECT_LINK, LinkRate
from uavrt.link.mavlink.sending.routes import Routes
from uavrt.link.mavlink.sending.statustext import chunks_of

log = get_logger()

TICK_S = 0.05
TUNNEL_SIZE = 128
COPIES = 256
"""Largest number of copied pulses that wait to be sent on a secondary link."""
UNSENT = 64
"""Largest number of messages to all stations that are kept until the first ground station
appears. In the send queue, they would delay the replies to file clients, which need not be
ground stations."""


class PacedSender:
    """Sends messages for the ground over one link, one at a time with a gap between them.

    `straight`: True for a direct link without an autopilot, which is fast and uses the shortest
    gap.
    """

    def __init__(
        self,
        send: Callable[[Message], None],
        target: Callable[[], Peer | None],
        clock_ns: Callable[[], int],
        *,
        gap_s: float = 0.020,
        straight: bool = False,
        frame_extra_bytes: int = 0,
        may_send: Callable[[], bool] = lambda: True,
    ) -> None:
        self._send = send
        self._may_send = may_send
        self._target = target
        self._clock_ns = clock_ns
        if straight:
            self._queue = PacedQueue(DIRECT_LINK_GAP_S, LinkRate(DIRECT_LINK), straight=True)
        else:
            self._queue = PacedQueue(gap_s)
        self._queue.frame_extra_bytes = frame_extra_bytes
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None

    @property
    def rate(self) -> LinkRate:
        """Rate limiter of this link."""
        return self._queue.rate

    def add_source(self, source: Source, priority: Priority) -> None:
        """Add a message source with a priority; call `wake` when it has a new message."""
        self._queue.add_source(source, priority)

    def put(self, item: Item, priority: Priority) -> None:
        """Queue a message with the given priority."""
        self._queue.put(item, priority)
        self.wake()

    def counters(self) -> dict[str, float]:
        """Counts of waiting, sent and dropped messages, for a health record."""
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
        """Send the queued messages until cancelled."""
        self._loop = asyncio.get_running_loop()
        try:
            self._pump()
            await self._loop.create_future()
        finally:
            self._loop = None
            self._cancel_timer()

    def wake(self) -> None:
        """Check the sources again, because one has a new message or may send sooner."""
        if self._loop is not None:
            self._pump()

    def _pump(self) -> None:
        """Send the messages that may be sent now, and set a timer for the next one.

        Timers are used instead of a task, because waking a task 200 times a second costs more
        than sending the messages.
        """
        self._cancel_timer()
        while (wait_ns := self._queue.wait_ns(now_ns := self._clock_ns())) is not None:
            if wait_ns == 0 and self._may_send():
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

    def _message(self, item: Item) -> Message:
        if isinstance(item, Message):
            return item
        target = Peer(*item.place) if item.place else self._target() or Peer(0, 0)
        return Tunnel(
            **target.address,
            payload_type=item.payload_type,
            payload_length=len(item.payload),
            payload=item.payload,
        )


class LinkView:
    """Access of one link to a source that several links share; only the active link sends."""

    def __init__(
        self, source: Source, link: int, group: "TunnelSender", views: list["LinkView"]
    ) -> None:
        self._source, self._link, self._group, self._views = source, link, group, views
        self._copies: deque[Item] = deque(maxlen=COPIES)

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until this link has a message to send [ns]; None without any."""
        if self._copies:
            return 0
        return self._source.wait_ns(now_ns) if self._group.link == self._link else None

    def take(self, now_ns: int, rate_bytes_s: float) -> Item | None:
        """Return the next message; queue a copy on other links that must carry it too."""
        if self._copies:
            return self._copies.popleft()
        if self._group.link != self._link:
            return None
        while (given := self._source.take(now_ns, rate_bytes_s)) is not None:
            place = None if isinstance(given, Message) else given.place
            links = self._group.links_for(place, now_ns)
            for link in links:
                if link != self._link:
                    self._views[link].leave(given)
                    self._group.wake_link(link)
            if self._link in links:
                return given
        return None

    def leave(self, given: Item) -> None:
        """Queue a copy of a message that another link sends; drop the oldest copy if too many
        wait.
        """
        self._group.copies_dropped += len(self._copies) == COPIES
        self._copies.append(given)


class TunnelSender:
    """Sends each message for the ground on the link that reaches the receiving stations.

    An answer is sent on the link on which its request arrived. Messages to all ground stations
    are sent on the smallest set of links that reaches them, so that each station receives them
    once.
    """

    def __init__(
        self, senders: list[PacedSender], routes: Routes, discovery: Discovery
    ) -> None:
        self._senders = senders
        self._routes = routes
        self._discovery = discovery
        self._links: tuple[int, ...] = (0,)
        self._unsent: deque[tuple[Item, Priority]] = deque(maxlen=UNSENT)
        self._text_id = 0
        self.changed: Callable[[], None] = lambda: None
        """Function called when pulses are sent by another link than before."""
        self.changes = 0
        self.copies_dropped = self.unsent_dropped = 0

    @property
    def link(self) -> int:
        """Number of the link that carries pulses."""
        return self._links[0]

    @property
    def rate(self) -> LinkRate:
        """Rate estimate of the link that carries pulses."""
        return self._senders[self.link].rate

    def rate_of(self, link: int) -> LinkRate:
        """Rate estimate of link number `link`."""
        return self._senders[link].rate

    def add_source(self, source: Source, priority: Priority) -> None:
        """Add a message source with a priority; call `wake` when it has a new message."""
        if len(self._senders) == 1:
            self._senders[0].add_source(source, priority)
            return
        views: list[LinkView] = []
        for number, sender in enumerate(self._senders):
            views.append(LinkView(source, number, self, views))
            sender.add_source(views[-1], priority)

    def add_source_on(self, link: int, source: Source, priority: Priority) -> None:
        """Send the messages of `source` by link number `link` only."""
        self._senders[link].add_source(source, priority)

    def send_tunnel(
        self,
        payload: bytes,
        priority: Priority,
        target: Peer | None = None,
        payload_type: int = 0,
    ) -> None:
        """Queue a payload for one peer, or for all (None); `TunnelError` above 128 bytes."""
        if len(payload) > TUNNEL_SIZE:
            raise TunnelError(
                f"a tunnel payload may have at most 128 bytes, but this one has {len(payload)}",
                payload,
            )
        place = None if target is None else target.place
        item = TunnelPayload(payload, place, payload_type)
        if target is None:
            self._put(item, priority)
        else:
            self._senders[target.link].put(item, priority)

    def send_message(
        self, message: Message, priority: Priority = Priority.STATUS, link: int | None = None
    ) -> None:
        """Queue any message for the ground, or for all peers on one link."""
        if link is None:
            self._put(message, priority)
        else:
            self._senders[link].put(message, priority)

    def send_text(self, severity: int, text: str) -> None:
        """Queue a text for the operators, split into STATUSTEXT messages."""
        self._text_id = self._text_id % 65_535 + 1
        for chunk in chunks_of(text, severity, self._text_id):
            self._put(chunk, Priority.STATUS)

    def wake(self) -> None:
        """Check the sources again, because one has a new message or may send sooner."""
        for sender in self._senders:
            sender.wake()

    def choose(self, now_ns: int) -> None:
        """Choose the links for messages to all stations; call it about every 50 ms."""
        if not self._discovery.known:
            return
        before = self._links
        if len(self._senders) > 1:
            self._links = self._routes.links_to(self._discovery.stations(now_ns), now_ns)
        links = self._links
        while self._unsent:
            self._put(*self._unsent.popleft())
        if links[0] != before[0]:
            self.changes += 1
            log.info("pulses are now sent over another link", link=links[0], before=before[0])
            self.changed()
            self.wake()

    def unanswered(self, now_ns: int) -> None:
        """Avoid the link that carries pulses for a while, because no station answers on it."""
        self._routes.doubt(self.link, now_ns)

    def links_for(self, place: tuple[int, int] | None, now_ns: int) -> tuple[int, ...]:
        """Numbers of the links for a message to one ground station, or to all (None)."""
        if place is None:
            return self._links
        return (self._routes.link_to(Peer(*place), now_ns),)

    def wake_link(self, link: int) -> None:
        """Check the sources of link number `link` again."""
        self._senders[link].wake()

    def counters(self) -> dict[str, float]:
        """Counts for a health record, summed over all links."""
        every = [sender.counters() for sender in self._senders]
        counts = {name: sum(each[name] for each in every) for name in every[0]}
        if len(every) > 1:
            counts["link_rate_bytes_s"] = every[self.link]["link_rate_bytes_s"]
            counts["link_in_use"] = self.link
            counts["link_changes"] = self.changes
            counts["tunnel_copies_dropped"] = self.copies_dropped
        counts["tunnel_unsent_dropped"] = self.unsent_dropped
        return counts

    def _put(self, item: Item, priority: Priority) -> None:
        if not self._discovery.known:
            self.unsent_dropped += len(self._unsent) == UNSENT
            self._unsent.append((item, priority))
            return
        for link in self._links:
            self._senders[link].put(item, priority)
