"""Measure round trips, and set the retransmission time-out (RFC 6298); no I/O."""

FIRST_RTO_S = 1.0
MIN_RTO_S = 0.4


class RoundTrips:
    """Smoothed round trip and retransmission time-out, by RFC 6298."""

    def __init__(self) -> None:
        self.smoothed_s: float | None = None
        self._variation_s = 0.0

    def add(self, trip_s: float) -> None:
        """Add the round trip of a message that was sent once [s]."""
        if self.smoothed_s is None:
            self.smoothed_s, self._variation_s = trip_s, trip_s / 2
        else:
            self._variation_s += (abs(trip_s - self.smoothed_s) - self._variation_s) / 4
            self.smoothed_s += (trip_s - self.smoothed_s) / 8

    @property
    def timeout_s(self) -> float:
        """Time after which a message without acknowledgement counts as lost [s]."""
        if self.smoothed_s is None:
            return FIRST_RTO_S
        return max(MIN_RTO_S, self.smoothed_s + 4 * self._variation_s)
