"""Choose the link to each peer. Pure.

Link 0 is the way to the autopilot and through it, by its radio, to the ground; the others lead
straight to ground stations, by Wi-Fi or cable. They are faster and reach less far, so a ground
station is spoken to over the first straight link on which it is heard, and over link 0 else.
"""

from collections import OrderedDict
from collections.abc import Iterable

from uavrt.mavlink.discovery import Peer
from uavrt.units import ns_from_s

FRESH_NS = ns_from_s(1.5)
"""Silence after which another link is taken. A ground station sends a heartbeat a second, so
one may be lost, and what is sent again then is there within the 2 s of a failover."""
STEADY_NS = ns_from_s(3.0)
"""How long a link must have been heard without such a silence to be taken in place of one that
works: at the edge of its reach it comes and goes."""
DOUBT_NS = ns_from_s(10.0)
"""How long a link is avoided on which we hear and are not heard."""
MAX_PEERS = 64


class Routes:
    """Remembers on which links each peer was heard.

    `links`: how many links there are.
    """

    def __init__(self, links: int) -> None:
        self._order = (*range(1, links), 0)
        self._heard: OrderedDict[Peer, dict[int, tuple[int, int]]] = OrderedDict()
        self._doubted_until: dict[int, int] = {}

    def heard(self, peer: Peer, link: int, now_ns: int) -> None:
        """A frame of `peer` has come by `link`."""
        links = self._heard.setdefault(peer, {})
        since_ns, last_ns = links.get(link, (now_ns, now_ns))
        links[link] = (since_ns if now_ns - last_ns < FRESH_NS else now_ns, now_ns)
        self._heard.move_to_end(peer)
        if len(self._heard) > MAX_PEERS:
            self._heard.popitem(last=False)

    def doubt(self, link: int, now_ns: int) -> None:
        """Note that nothing sent over `link` is answered, though the peer is heard."""
        self._doubted_until[link] = now_ns + DOUBT_NS

    def link_to(self, peer: Peer, now_ns: int) -> int:
        """Link over which to speak to a peer; the last one heard when all are silent."""
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
        """Links that together reach all of them, the preferred first."""
        needed = {self.link_to(peer, now_ns) for peer in peers}
        return tuple(link for link in self._order if link in needed)
