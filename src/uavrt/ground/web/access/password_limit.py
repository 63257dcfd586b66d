"""Limit password attempts."""

import ipaddress
from collections import OrderedDict, deque
from collections.abc import Callable

from uavrt.core.clock import monotonic_s

TRIES = 5
WINDOW_S = 60.0
LEAST_PASSWORD = 8
"""Minimum length of a password. Guesses from many addresses are limited only by the server's
speed, 3000 a second. At 10 000 a second, half of all passwords of eight random letters and
digits (36⁸) last 4 years."""


class PasswordLimit:
    """Limits wrong passwords to five a minute per address, never the right one, however many
    others guess; a browser with the cookie needs none.
    """

    def __init__(self, now_s: Callable[[], float] = monotonic_s) -> None:
        self._now_s = now_s
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()
        """Times of each address's last wrong passwords [s], ordered by the oldest one."""
        self.refused = 0
        """Number of log-in attempts rejected without checking the password."""

    def wait_s(self, address: str) -> float:
        """Time until the next password from an address is checked [s]; 0: at once."""
        times = self._wrong.get(_place(address), deque())
        wait_s = times[0] + WINDOW_S - self._now_s() if len(times) == TRIES else 0.0
        self.refused += wait_s > 0.0
        return max(0.0, wait_s)

    def wrong(self, address: str) -> None:
        """Record a wrong password from an address."""
        now_s, place = self._now_s(), _place(address)
        self._wrong.setdefault(place, deque(maxlen=TRIES)).append(now_s)
        self._wrong.move_to_end(place)
        while next(iter(self._wrong.values()))[-1] <= now_s - WINDOW_S:
            self._wrong.popitem(last=False)


def _place(address: str) -> str:
    """Address that the limit counts: IPv4, or the IPv6 /64 network of a household."""
    try:
        known = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(known, ipaddress.IPv6Address) and known.ipv4_mapped is not None:
        return str(known.ipv4_mapped)
    if isinstance(known, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((known, 64), strict=False))
    return str(known)
