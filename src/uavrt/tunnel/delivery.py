"""Track which pulses were sent: each goes to the ground once, and at once.

The report that a pulse is recorded comes later. For a pulse sent before this process started,
or by a process that died meanwhile, the flight's database has its state: its pose, and whether
it has reached the ground.
"""

from collections import OrderedDict, deque

from uavrt.messages import PulseKey

REMEMBERED = 500
"""Pulses sent and recorded whose repeated reports are ignored: 20 s of 25 a second, 50 kB."""
MOST_UNRECORDED = 20_000
"""Most pulses sent and not yet recorded, while the recorder is away."""


class PulseDelivery:
    """Sends each pulse once."""

    def __init__(self) -> None:
        self._unrecorded: OrderedDict[PulseKey, None] = OrderedDict()
        self._recent: deque[PulseKey] = deque()
        self._recorded = set[PulseKey]()
        """Recorded ones of `_recent`."""
        self._news = set[PulseKey]()
        """Pulses unrecorded when a ground station came that lacks them."""

    @property
    def unrecorded(self) -> int:
        """Number of pulses sent that the recorder has not confirmed yet."""
        return len(self._unrecorded)

    def let_out(self, key: PulseKey) -> bool:
        """Whether to send a pulse; False if it was sent before."""
        if key in self._unrecorded or key in self._recorded:
            return False
        self._unrecorded[key] = None
        if len(self._unrecorded) > MOST_UNRECORDED:
            self._unrecorded.popitem(last=False)
        return True

    def station_came(self) -> None:
        """Note a new ground station, whose pulses are read from the database.

        Unrecorded pulses are not there yet; `recorded` handles them.
        """
        self._news = set(self._unrecorded)

    def recorded(self, key: PulseKey) -> bool:
        """Note that a pulse is recorded; False if it must be read from the database.

        This is so if this process has not sent it, or a station came since.
        """
        if key in self._recorded:
            return True
        known = self._unrecorded.pop(key, key) is None
        if known:
            self._recorded.add(key)
            self._recent.append(key)
            while len(self._recent) > REMEMBERED:
                self._recorded.discard(self._recent.popleft())
        if key in self._news:
            self._news.discard(key)
            return False
        return known
