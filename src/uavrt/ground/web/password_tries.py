"""Limit password attempts."""

import ipaddress
from collections import OrderedDict, deque
from collections.abc import Callable

from uavrt.clock import monotonic_s

TRIES = 5
WINDOW_S = 60.0
LEAST_PASSWORD = 8
"""Characters of a password. Guesses from many addresses do not delay the right password, so the
server's speed limits them: it answers 3000 a second on two cores. Eight random letters and
digits (36⁸) are then found within 4 years by half even at 10 000 a second, and from one address
not in a million years."""


class Guesses:
    """Counts wrong passwords by address: five a minute from each.

    Other addresses' guesses never delay the right password, and who has the cookie is not
    asked again.

    `now_s`: time now.
    """

    def __init__(self, now_s: Callable[[], float] = monotonic_s) -> None:
        self._now_s = now_s
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()
        """Times of each place's last wrong passwords; the place with the oldest one first."""
        self.refused = 0
        """Attempts that were not checked."""

    def wait_s(self, address: str) -> float:
        """Time until the next attempt from an address is checked; 0 when it may be now."""
        times = self._wrong.get(_place(address), deque())
        wait_s = times[0] + WINDOW_S - self._now_s() if len(times) == TRIES else 0.0
        self.refused += wait_s > 0.0
        return max(0.0, wait_s)

    def wrong(self, address: str) -> None:
        """Note a wrong password."""
        now_s, place = self._now_s(), _place(address)
        self._wrong.setdefault(place, deque(maxlen=TRIES)).append(now_s)
        self._wrong.move_to_end(place)
        while next(iter(self._wrong.values()))[-1] <= now_s - WINDOW_S:
            self._wrong.popitem(last=False)


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
