"""Acknowledge stored pulses and recognise repeated pulses. No I/O.

A receipt names only pulses on the ground station's disk, and repeats some earlier hashes, so
that few pulses are sent again because a receipt was lost.
"""

from collections import deque
from collections.abc import Callable, Iterable

from uavrt.core.newest import Newest
from uavrt.core.units import ns_from_s
from uavrt.link.tunnel.own_messages.private import MAX_HASHES, Receipt, payload_hash

PERIOD_NS = ns_from_s(0.150)
SIGN_OF_LIFE_NS = ns_from_s(1.0)
REPEATED = 6
"""Number of hashes of earlier pulses in each receipt. With them, one acknowledgement in 25 is
lost at 20 % frame loss."""
REMEMBERED = 500_000
"""Maximum number of pulses remembered to recognise repetitions: 17 hours at 8 a second."""


class Receipts:
    """Keeps track of stored pulses and makes receipts that acknowledge them to the drone."""

    def __init__(
        self,
        store: int,
        known: Iterable[int] = (),
        *,
        keep: Callable[[int, Callable[[], None]], object] = lambda _number, then: then(),
    ) -> None:
        self.store = store
        self._keep = keep
        self.most = MAX_HASHES
        """Maximum number of pulse hashes in one receipt to the drone."""
        self._known: Newest[int, None] = Newest(REMEMBERED)
        self._known.update(dict.fromkeys(known))
        self._due: list[int] = []
        self._earlier: deque[int] = deque(maxlen=REPEATED)
        self._sent_ns: int | None = None
        self.duplicates = 0

    def seen(self, payload: bytes) -> bool:
        """True if a pulse has arrived before; the next receipt then acknowledges it again."""
        number = payload_hash(payload)
        if number not in self._known:
            return False
        self.duplicates += 1
        if number not in self._due:
            self._due.append(number)
        return True

    def stored(self, payload: bytes) -> None:
        """Record that a pulse is now stored on disk."""
        number = payload_hash(payload)
        self._known[number] = None
        self._keep(number, lambda: self._due.append(number))

    def wait_ns(self, now_ns: int) -> int:
        """Time until the next receipt is due [ns]."""
        if self._sent_ns is None or len(self._due) >= self.most:
            return 0
        period_ns = PERIOD_NS if self._due else SIGN_OF_LIFE_NS
        return max(0, self._sent_ns + period_ns - now_ns)

    def next_due(self, now_ns: int) -> Receipt | None:
        """Return the receipt that is due now; None if none is."""
        if self.wait_ns(now_ns) > 0:
            return None
        self._sent_ns = now_ns
        hashes, self._due = self._due[: self.most], self._due[self.most :]
        again = [number for number in self._earlier if number not in hashes]
        self._earlier.extend(hashes)
        room = self.most - len(hashes)
        if hashes and room:  # alone they are not worth a longer message
            hashes += again[-room:]
        return Receipt(store=self.store, hashes=tuple(hashes))
