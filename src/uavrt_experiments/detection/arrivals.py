"""How a radio's samples arrive: jittered, held up, and with unreported losses.

Arrivals only, no samples: hours of a stream in a second, for what is measured by counting.
`uavrt.simulation.airspy_rx` loses and delays real samples in the same ways.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """A radio and the way of its samples to us."""

    sample_rate_hz: float = 3_000_000.0
    rate_error_ppm: float = 0.0
    transfer_s: float = 65_536 / 3_000_000
    """What the radio's program writes at once."""
    loss_share: float = 0.0
    """Of the samples, this share is lost without a word."""
    loss_s: float = 0.005
    """Duration of each [s]."""
    jitter_s: float = 0.002
    """Standard deviation of each arrival's delay."""
    jitter: Literal["exponential", "normal"] = "exponential"
    stall_share: float = 0.0
    """Of the arrivals, at this share something is held up."""
    stall_s: tuple[float, float] = (0.05, 0.3)
    """Shortest and longest stall; what came meanwhile arrives at its end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """What arrived at once."""

    first: int
    """Index of its first sample among those that came."""
    count: int
    arrival_s: float
    """When [s], the first sample having been taken at 0."""


class DeliveredStream:
    """The arrivals of a stream, and where its samples truly belong.

    `delivery`: the radio and its way.
    `duration_s`: how long.
    `rng`: chance.
    """

    def __init__(self, delivery: Delivery, duration_s: float, rng: np.random.Generator) -> None:
        self.delivery = delivery
        self.true_rate_hz = delivery.sample_rate_hz * (1.0 + delivery.rate_error_ppm * 1e-6)
        self._rng = rng
        self._samples = round(duration_s * self.true_rate_hz)
        gap = max(1, round(delivery.loss_s * self.true_rate_hz))
        kept_s = (
            delivery.loss_s * (1.0 / delivery.loss_share - 1.0) if delivery.loss_share else 0
        )
        count = 1 + math.ceil(3.0 * duration_s / (delivery.loss_s + kept_s)) if kept_s else 0
        pauses = rng.exponential(kept_s * self.true_rate_hz, count).astype(np.int64)
        places = np.cumsum(pauses)
        self.losses = places[places + gap * np.arange(1, count + 1) < self._samples]
        """Indices, among the samples that came, before which some are missing."""
        self.gap = gap
        """Samples of each loss."""
        self.samples = self._samples - gap * len(self.losses)
        """How many came."""

    @property
    def lost(self) -> int:
        """How many samples never came."""
        return self.gap * len(self.losses)

    def true_s(self, index: int) -> float:
        """When a sample was taken [s]; the index counts those that came."""
        missing = int(np.searchsorted(self.losses, index, side="right"))
        return (index + self.gap * missing) / self.true_rate_hz

    def since_loss_s(self, index: int) -> float:
        """How long before a sample the last loss ended [s]; infinite before the first."""
        at = int(np.searchsorted(self.losses, index, side="right")) - 1
        if at < 0:
            return math.inf
        return (index - int(self.losses[at])) / self.true_rate_hz

    def transfers(self) -> Iterator[Transfer]:
        """Return the arrivals in order."""
        delivery, rng = self.delivery, self._rng
        size = round(delivery.transfer_s * delivery.sample_rate_hz)
        free_s = 0.0
        for first in range(0, self.samples - size, size):
            delay_s = (
                rng.exponential(delivery.jitter_s)
                if delivery.jitter == "exponential"
                else rng.normal(0.0, delivery.jitter_s)
            )
            arrival_s = max(self.true_s(first + size - 1) + delay_s, free_s)
            if delivery.stall_share and rng.random() < delivery.stall_share:
                arrival_s += rng.uniform(*delivery.stall_s)
            free_s = arrival_s
            yield Transfer(first=first, count=size, arrival_s=arrival_s)
