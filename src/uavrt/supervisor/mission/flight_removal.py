"""Flights that a ground station may remove, in two steps. Pure except for disk reads.

The first command lists them, the second, later than any repetition of the first, removes them.
The newest flight and starred ones stay.
"""

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

from uavrt.clock import monotonic_s
from uavrt.recording.flight_order import with_copies
from uavrt.recording.layout import FlightLayout

REPEATED_S = 10.0
"""Time in which a repetition is the same request [s]: stations repeat four times in 8 s."""
FORGOTTEN_S = 120.0
"""Time after which a second step counts as a first one [s]."""


def removable(flights: Sequence[Path]) -> list[Path]:
    """List the flights that may go, oldest first: not the newest or its copies, not starred."""
    older = itertools.chain(*with_copies(flights)[:-1])
    return [flight for flight in older if not FlightLayout(flight).star.exists()]


class SecondStep:
    """Distinguishes the second step of a request from the first and its repetitions."""

    def __init__(self, clock_s: Callable[[], float] = monotonic_s) -> None:
        self._clock_s = clock_s
        self._asked: tuple[str, float] | None = None

    def is_meant(self, source: str) -> bool:
        """Handle a request; True for the second step by the sender of the first."""
        now_s = self._clock_s()
        asked, self._asked = self._asked, (source, now_s)
        if asked is None or asked[0] != source:
            return False
        meant = REPEATED_S <= now_s - asked[1] <= FORGOTTEN_S
        if meant:
            self._asked = None
        return meant
