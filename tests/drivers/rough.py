"""A link that brings telemetry late, out of order, twice or not at all."""

import heapq
import random
from collections.abc import Iterable, Iterator

from uavrt.link.mavlink.message import Message


class Rough:
    """One such link.

    `late_s`, `jitter_s`: what each message takes at least, and besides at most.
    `loss`, `doubled`: shares of messages.
    """

    def __init__(
        self,
        rng: random.Random,
        *,
        late_s: float = 0.0,
        jitter_s: float = 0.0,
        loss: float = 0.0,
        doubled: float = 0.0,
    ) -> None:
        self._rng, self.late_s, self._jitter_s = rng, late_s, jitter_s
        self._loss, self._doubled = loss, doubled
        self._way: list[tuple[float, int, Message]] = []
        self._number = 0

    def __call__(self, now_s: float, told: Iterable[Message]) -> Iterator[Message]:
        """What arrives by now; with jitter one may overtake another."""
        for message in told:
            copies = 2 if self._rng.random() < self._doubled else 1
            if self._rng.random() < self._loss:
                continue
            for _ in range(copies):
                self._number += 1
                at_s = now_s + self.late_s + self._rng.uniform(0.0, self._jitter_s)
                heapq.heappush(self._way, (at_s, self._number, message))
        while self._way and self._way[0][0] <= now_s + 1e-9:
            yield heapq.heappop(self._way)[2]
