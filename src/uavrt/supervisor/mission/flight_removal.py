"""Which flights a ground station may remove, with confirmation. Pure except for disk reads.

Two steps: the first command says what would go, the second, later than any repetition of the
first, lets it go. The newest flight and those that are starred stay.
"""

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

from uavrt.clock import monotonic_s
from uavrt.recording.flight_order import with_copies
from uavrt.recording.layout import FlightLayout

REPEATED_S = 10.0
"""A ground station repeats what is not acknowledged four times in 8 s: within this after the
last one it is the same wish."""
FORGOTTEN_S = 120.0
"""Later than this the second step is a first one."""


def removable(flights: Sequence[Path]) -> list[Path]:
    """Get those of the flights, the oldest first, that may go: not the newest, not starred.

    The newest stays with its copies.
    """
    older = itertools.chain(*with_copies(flights)[:-1])
    return [flight for flight in older if not FlightLayout(flight).star.exists()]


class SecondStep:
    """Distinguishes the second step of a request from the first and its repetitions."""

    def __init__(self, clock_s: Callable[[], float] = monotonic_s) -> None:
        self._clock_s = clock_s
        self._asked: tuple[str, float] | None = None

    def is_meant(self, source: str) -> bool:
        """Handle a wish; True when it is the second step of the one who took the first."""
        now_s = self._clock_s()
        asked, self._asked = self._asked, (source, now_s)
        if asked is None or asked[0] != source:
            return False
        meant = REPEATED_S <= now_s - asked[1] <= FORGOTTEN_S
        if meant:
            self._asked = None
        return meant
