"""Choose the link to each peer; no I/O.

Link 0 leads to the autopilot and by its radio to the ground. The others lead directly to ground
stations, by Wi-Fi or cable; they are faster and reach less far. A ground station is reached
over the first direct link on which it is received, else over link 0.
"""

from collections.abc import Iterable

from uavrt.core.newest import Newest
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.discovery import Peer

FRESH_NS = ns_from_s(1.5)
"""Silence on a link after which another link is used [ns]. Ground stations send a heartbeat a
second: one may be lost, and repetitions still arrive within the 2 s of a failover."""
STEADY_NS = ns_from_s(3.0)
"""Time without silence above `FRESH_NS` after which a link may replace a working one [ns]. At
the edge of its range a link comes and goes."""
DOUBT_NS = ns_from_s(10.0)
"""Time for which a link that receives but does not deliver is avoided [ns]."""
MAX_PEERS = 64


class Routes:
    """Links on which each peer was received, and when."""

    def __init__(self, links: int) -> None:
        self._order = (*range(1, links), 0)
        self._heard: Newest[Peer, dict[int, tuple[int, int]]] = Newest(MAX_PEERS)
        self._doubted_until: dict[int, int] = {}

    def received(self, peer: Peer, link: int, now_ns: int) -> None:
        """Record that a frame of `peer` has arrived by `link`."""
        self._heard[peer] = links = self._heard.get(peer, {})
        since_ns, last_ns = links.get(link, (now_ns, now_ns))
        links[link] = (since_ns if now_ns - last_ns < FRESH_NS else now_ns, now_ns)

    def doubt(self, link: int, now_ns: int) -> None:
        """Avoid `link` for a while: peers are received there, but do not answer."""
        self._doubted_until[link] = now_ns + DOUBT_NS

    def link_to(self, peer: Peer, now_ns: int) -> int:
        """Number of the link to a peer; if all are silent, the one that received it last."""
        links = self._heard.get(peer)
        if not links:
            return 0
        best, rank = 0, (-1, -1, -1)
        for place, link in enumerate(reversed(self._order)):
            if link not in links:
                continue
            since_ns, last_ns = links[link]
            fresh = now_ns - last_ns < FRESH_NS
            trusted = now_ns >= self._doubted_until.get(link, now_ns)
            steady = fresh and now_ns - since_ns >= STEADY_NS
            found = (2 * trusted + steady, place, 0) if fresh else (-1, last_ns, 0)
            if found > rank:
                best, rank = link, found
        return best

    def links_to(self, peers: Iterable[Peer], now_ns: int) -> tuple[int, ...]:
        """Smallest set of links that reach all given peers, the preferred one first."""
        needed = {self.link_to(peer, now_ns) for peer in peers}
        return tuple(link for link in self._order if link in needed)
