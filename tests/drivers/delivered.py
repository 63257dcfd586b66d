"""Which of a bay's pulses have come to its ground station, and after how long."""

import asyncio
from collections.abc import Iterable
from typing import Any

from made import FREQUENCY_HZ

from uavrt.core.messages import PulsePose


def numbers(events: Iterable[object]) -> list[int]:
    """Numbers of the pulses among a ground station's events: hertz above the tag's."""
    return [
        round(event.pulse.frequency_hz - FREQUENCY_HZ)
        for event in events
        if isinstance(event, PulsePose)
    ]


class Delays:
    """Notes when each pulse was sent by the detector and received by the ground station."""

    def __init__(self, bay: Any) -> None:
        self._bay = bay
        self.sent_s: dict[int, float] = {}
        self.seen_s: dict[int, float] = {}

    def send(self, number: int) -> None:
        """Let the detector find a pulse."""
        self.sent_s[number] = asyncio.get_running_loop().time()
        self._bay.send_pulse(number)

    def append(self, event: object) -> None:
        """Take an event of the ground station."""
        for number in numbers([event]):
            self.seen_s.setdefault(number, asyncio.get_running_loop().time())

    def p95_s(self, begin: int = 0, end: int | None = None) -> float:
        """Delay that 95 % of the pulses from one to another number do not exceed."""
        places = list(self.sent_s)[begin:end]
        delays = sorted(self.seen_s.get(n, float("inf")) - self.sent_s[n] for n in places)
        return delays[int(0.95 * len(delays))]
