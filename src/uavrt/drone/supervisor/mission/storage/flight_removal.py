"""Decide which flights a ground station's request removes; this module deletes nothing.

The first request lists the flights. A second one, sent later than any retry of the first,
removes them. The newest flight and starred flights stay.
"""

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

from uavrt.core.clock import monotonic_s
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import with_copies

RETRY_WITHIN_S = 10.0
"""Time in which a repeated removal counts as a retry [s]; stations retry for 8 s."""
CONFIRM_WITHIN_S = 120.0
"""Time within which a second removal request confirms the first [s]."""


def removable(flights: Sequence[Path]) -> list[Path]:
    """Removable flights, oldest first: all but the newest, its copies and starred flights."""
    older = itertools.chain(*with_copies(flights)[:-1])
    return [flight for flight in older if not FlightLayout(flight).star.exists()]


class SecondStep:
    """Detects a confirming second request, as opposed to a first request or its retries."""

    def __init__(self, clock_s: Callable[[], float] = monotonic_s) -> None:
        self._clock_s = clock_s
        self._asked: tuple[str, float] | None = None

    def is_confirmation(self, source: str) -> bool:
        """Note a request; True if it confirms an earlier request of the same sender."""
        now_s = self._clock_s()
        asked, self._asked = self._asked, (source, now_s)
        if asked is None or asked[0] != source:
            return False
        meant = RETRY_WITHIN_S <= now_s - asked[1] <= CONFIRM_WITHIN_S
        if meant:
            self._asked = None
        return meant
