"""Choose the link for messages to each peer; no I/O.

Link 0 leads to the autopilot, and by its radio to the ground. The other links lead directly to
ground stations by Wi-Fi or cable; they are faster, but have less range. Messages to a ground
station use the first direct link on which its frames arrive, otherwise link 0.
"""

from collections.abc import Iterable

from uavrt.core.newest import Newest
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.discovery import Peer

FRESH_NS = ns_from_s(1.5)
"""Time without frames on a link after which another link is used [ns]. Ground stations send one
heartbeat per second. One may be lost, and repeated messages still arrive within the 2 s of a
failover."""
STEADY_NS = ns_from_s(3.0)
"""Time for which frames must arrive on a link without a pause above `FRESH_NS` before it
replaces a working link [ns]. A link at the edge of its range fails again and again."""
DOUBT_NS = ns_from_s(10.0)
"""Time for which a link is avoided after peers were received on it but did not answer [ns]."""
MAX_PEERS = 64


class Routes:
    """Records on which links, and when, frames of each peer have arrived."""

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
        """Avoid `link` for a while, as peers' frames arrive on it but their answers do not."""
        self._doubted_until[link] = now_ns + DOUBT_NS

    def link_to(self, peer: Peer, now_ns: int) -> int:
        """Return the number of the link to a peer; if all are silent, the link of its last
        frame.
        """
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
