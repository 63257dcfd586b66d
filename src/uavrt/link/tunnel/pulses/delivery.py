"""Track which pulses were sent, so that each is sent once.

A pulse is sent before it is recorded, and the recorder confirms it later. After a restart of
the connection process, the flight's database shows which pulses have a pose and were received
on the ground.
"""

from uavrt.core.messages import PulseKey
from uavrt.core.newest import Newest

REMEMBERED = 500
"""Number of recorded pulses that are remembered, so that repeated reports are ignored: 20 s at
25 pulses per second, or 50 kB."""
MOST_UNRECORDED = 20_000
"""Largest number of sent pulses that are kept until the recorder confirms them; it may be
restarting."""


class PulseDelivery:
    """Decides whether a pulse is sent, so that each pulse is sent once."""

    def __init__(self) -> None:
        self._unrecorded: Newest[PulseKey, None] = Newest(MOST_UNRECORDED)
        self._recorded: Newest[PulseKey, None] = Newest(REMEMBERED)
        self._news = set[PulseKey]()
        """Keys of sent pulses that were not yet recorded when a new ground station appeared."""

    @property
    def unrecorded(self) -> int:
        """Number of sent pulses that the recorder has not confirmed yet."""
        return len(self._unrecorded)

    def may_send(self, key: PulseKey) -> bool:
        """True if a pulse was not sent before; the pulse then counts as sent."""
        if key in self._unrecorded or key in self._recorded:
            return False
        self._unrecorded[key] = None
        return True

    def station_appeared(self) -> None:
        """Handle a new ground station, for which pulses are read from the database.

        Pulses not recorded yet are missing there; `recorded` handles them.
        """
        self._news = set(self._unrecorded)

    def recorded(self, key: PulseKey) -> bool:
        """Handle a recorded pulse; False if some station must get it from the database."""
        if key in self._recorded:
            return True
        known = self._unrecorded.pop(key, key) is None
        if known:
            self._recorded[key] = None
        if key in self._news:
            self._news.discard(key)
            return False
        return known
