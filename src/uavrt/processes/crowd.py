"""Limit the ground station messages we process, so that a flood does not delay pulses.

The commanding station has an allowance of its own. All others share one, since a single sender
can use many names. Messages beyond it are counted and dropped.
"""

from uavrt.allowance import Allowance

Place = tuple[int, int]
"""System and component id."""

OWN_BURST, OWN_PER_S = 400, 50
"""Allowance of the commander: a hundred tags three times, seven receipts a second."""
OTHERS_BURST, OTHERS_PER_S = 120, 60
"""Allowance of all others for messages without an answer: receipts of eight stations."""
QUESTIONS_BURST, QUESTIONS_PER_S = 12, 1
"""Allowance of messages with an answer: the beginning of an upload, a list of the parameters.
Answers go after pulses, but use the link."""
FILES_BURST, FILES_PER_S = 200, 100
"""Allowance of requests for files: a client that reads piece by piece gets 24 kB/s."""
UNPROVEN_FILES_BURST, UNPROVEN_FILES_PER_S = 8, 1
"""Allowance of requests without a proof while a drone with a key detects: pulses go first."""


class Crowd:
    """Decides which messages to process."""

    def __init__(self) -> None:
        self._commander: Place | None = None
        self._own = Allowance(burst=OWN_BURST, per_s=OWN_PER_S)
        self._others = Allowance(burst=OTHERS_BURST, per_s=OTHERS_PER_S)
        self._files = Allowance(burst=FILES_BURST, per_s=FILES_PER_S)
        self._unproven = Allowance(burst=UNPROVEN_FILES_BURST, per_s=UNPROVEN_FILES_PER_S)
        self._questions = Allowance(burst=QUESTIONS_BURST, per_s=QUESTIONS_PER_S)
        self.passed_over = 0
        """Messages dropped as too many."""

    @property
    def has_commander(self) -> bool:
        """Whether the commanding station is known."""
        return self._commander is not None

    def commander(self, place: Place) -> None:
        """Set the commanding station."""
        if place != self._commander:
            self._commander = place
            self._own = Allowance(burst=OWN_BURST, per_s=OWN_PER_S)

    def commands(self, place: Place) -> bool:
        """Whether this station is the commanding one; its answers go before pulses."""
        return place == self._commander

    def admits_file_request(self, place: Place, now_ns: int, *, proof: bool = True) -> bool:
        """Whether to handle a file request; always for the commander with proof of the key."""
        allowance = self._files if proof else self._unproven
        admitted = (proof and place == self._commander) or allowance.take(now_ns)
        self.passed_over += not admitted
        return admitted

    def admits(self, place: Place, now_ns: int, *, answers: int = 0) -> bool:
        """Whether to process a message; also `answers`, messages that answer it."""
        if place == self._commander:
            admitted = self._own.take(now_ns)
        elif answers:
            admitted = all(self._questions.take(now_ns) for _ in range(answers))
        else:
            admitted = self._others.take(now_ns)
        self.passed_over += not admitted
        return admitted
