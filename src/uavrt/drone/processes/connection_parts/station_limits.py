"""Rate limits for ground stations' messages, so that a flood of them delays no pulses.

The station in command has its own allowance. All others share one, since one sender can use
many names. Messages beyond it are counted and dropped.
"""

from uavrt.link.allowance import Allowance

Place = tuple[int, int]
"""MAVLink system and component id of a ground station."""

OWN_BURST, OWN_PER_S = 400, 50
"""Messages allowed from the station in command, at once and per second: enough to upload a
hundred tags three times, and for seven receipts a second."""
OTHERS_BURST, OTHERS_PER_S = 120, 60
"""Messages allowed from all other stations, at once and per second; fits receipts of eight."""
ANSWERED_BURST, ANSWERED_PER_S = 12, 1
"""Messages that need an answer, such as an upload, allowed at once and per second. Answers have
a lower priority than pulses, but use the link."""
FILES_BURST, FILES_PER_S = 200, 100
"""File requests allowed at once and per second; reading in pieces gets 24 kB/s."""
OPEN_FILES_BURST, OPEN_FILES_PER_S = 8, 1
"""Unauthenticated file requests allowed at once and per second in flight if a key is set."""


class StationLimits:
    """Rate limits for ground stations: admits or drops each of their messages."""

    def __init__(self) -> None:
        self._commander: Place | None = None
        self._own = Allowance(burst=OWN_BURST, per_s=OWN_PER_S)
        self._others = Allowance(burst=OTHERS_BURST, per_s=OTHERS_PER_S)
        self._files = Allowance(burst=FILES_BURST, per_s=FILES_PER_S)
        self._open_files = Allowance(burst=OPEN_FILES_BURST, per_s=OPEN_FILES_PER_S)
        self._answered = Allowance(burst=ANSWERED_BURST, per_s=ANSWERED_PER_S)
        self.dropped = 0
        """Number of messages from ground stations dropped because too many arrived."""

    @property
    def has_commander(self) -> bool:
        """True if a station is in command."""
        return self._commander is not None

    def commander(self, place: Place) -> None:
        """Set the station in command."""
        if place != self._commander:
            self._commander = place
            self._own = Allowance(burst=OWN_BURST, per_s=OWN_PER_S)

    def commands(self, place: Place) -> bool:
        """True for the station in command; its answers are sent before pulses."""
        return place == self._commander

    def admits_file_request(self, place: Place, now_ns: int, *, proof: bool = True) -> bool:
        """True if the limits allow a file request.

        `proof` is True if the request is authenticated or needs no authentication.
        """
        allowance = self._files if proof else self._open_files
        admitted = (proof and place == self._commander) or allowance.take(now_ns)
        self.dropped += not admitted
        return admitted

    def admits(self, place: Place, now_ns: int, *, answers: int = 0) -> bool:
        """True if the limits allow a message that causes `answers` messages in reply."""
        if place == self._commander:
            admitted = self._own.take(now_ns)
        elif answers:
            admitted = all(self._answered.take(now_ns) for _ in range(answers))
        else:
            admitted = self._others.take(now_ns)
        self.dropped += not admitted
        return admitted
