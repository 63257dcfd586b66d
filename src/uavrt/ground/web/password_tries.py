"""Limit password attempts."""

import ipaddress
from collections import deque
from collections.abc import Callable

from uavrt.clock import monotonic_s

TRIES = 5
TRIES_OF_ALL = 60
WINDOW_S = 60.0
MAX_PLACES = 1000


class Guesses:
    """Counts wrong passwords by where they come from, and all together.

    Five a minute from one address, and 60 from all: a password of six random letters is then
    found within five years by half. Who has the cookie is not asked, and not shut out by the
    guesses of others at another address.

    Parameters
    ----------
    now_s : callable
        Time now.
    """

    def __init__(self, now_s: Callable[[], float] = monotonic_s) -> None:
        self._now_s = now_s
        self._wrong: dict[str, deque[float]] = {}
        self._all: deque[float] = deque()
        self.refused = 0
        """Tries that were not looked at."""

    def wait_s(self, address: str) -> float:
        """Time until the next try from an address is looked at; 0 when it may be now."""
        now_s = self._now_s()
        own = self._recent(self._wrong.get(_place(address), deque()), now_s)
        every = self._recent(self._all, now_s)
        waits = [
            times[-limit] + WINDOW_S - now_s
            for times, limit in ((own, TRIES), (every, TRIES_OF_ALL))
            if len(times) >= limit
        ]
        if waits:
            self.refused += 1
        return max(waits, default=0.0)

    def wrong(self, address: str) -> None:
        """Note a wrong password."""
        now_s = self._now_s()
        if len(self._wrong) >= MAX_PLACES:
            self._wrong = {
                place: times
                for place, times in self._wrong.items()
                if self._recent(times, now_s)
            }
        self._wrong.setdefault(_place(address), deque(maxlen=TRIES)).append(now_s)
        self._all.append(now_s)

    @staticmethod
    def _recent(times: deque[float], now_s: float) -> deque[float]:
        while times and times[0] <= now_s - WINDOW_S:
            times.popleft()
        return times


def _place(address: str) -> str:
    """An address, or of IPv6 the network of a household: it has 2⁶⁴ of them."""
    try:
        known = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(known, ipaddress.IPv6Address) and known.ipv4_mapped is not None:
        return str(known.ipv4_mapped)
    if isinstance(known, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((known, 64), strict=False))
    return str(known)
