"""Track which pulses have gone out: each goes to the ground once, and at once.

The word that a pulse is recorded comes later. Of a pulse that this process has not let out,
because another one before it did or died over it, the flight's database knows what became of
it: whether it has reached the ground, and if not, with which pose it goes.
"""

from collections import OrderedDict, deque

from uavrt.messages import PulseKey

REMEMBERED = 500
"""Pulses let out and recorded lately, of which another word is ignored: 20 s of 25 pulses a
second, in 50 kB. More would fill for hours, and the word comes once."""
MOST_UNRECORDED = 20_000
"""Pulses let out and not yet recorded, while the recorder is away."""


class PulseDelivery:
    """Sends each pulse once."""

    def __init__(self) -> None:
        self._unrecorded: OrderedDict[PulseKey, None] = OrderedDict()
        self._recent: deque[PulseKey] = deque()
        self._recorded = set[PulseKey]()
        """Those in `_recent`."""
        self._news = set[PulseKey]()
        """Unrecorded when a ground station came that has not got them."""

    @property
    def unrecorded(self) -> int:
        """Pulses let out that the recorder has not confirmed yet."""
        return len(self._unrecorded)

    def let_out(self, key: PulseKey) -> bool:
        """Whether a pulse may go: not one that has gone before."""
        if key in self._unrecorded or key in self._recorded:
            return False
        self._unrecorded[key] = None
        if len(self._unrecorded) > MOST_UNRECORDED:
            self._unrecorded.popitem(last=False)
        return True

    def station_came(self) -> None:
        """A ground station has come that had nothing yet, and looks for it in the database.

        What is not recorded yet is not there; `recorded` will say so when it is.
        """
        self._news = set(self._unrecorded)

    def recorded(self, key: PulseKey) -> bool:
        """The recorder has it; False when the database has to be looked at for it.

        So it is when this process has not let it out, and when somebody may miss it who came
        since.
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
