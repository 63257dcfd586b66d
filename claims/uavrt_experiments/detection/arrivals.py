"""Arrivals of a radio's samples: jittered, delayed, and with unreported losses.

Only arrival times are simulated, no samples: hours of a stream in a second, for measurements of
the clock. `uavrt.simulation.airspy_rx` loses and delays real samples in the same manner.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """Properties of a radio and of its connection to the computer."""

    sample_rate_hz: float = 3_000_000.0
    rate_error_ppm: float = 0.0
    transfer_s: float = 65_536 / 3_000_000
    """Duration of one write of the radio's program [s]."""
    loss_share: float = 0.0
    """Share of the samples lost without a report."""
    loss_s: float = 0.005
    """Duration of each loss [s]."""
    jitter_s: float = 0.002
    """Standard deviation of each arrival's delay [s]."""
    jitter: Literal["exponential", "normal"] = "exponential"
    stall_share: float = 0.0
    """Share of the arrivals that are delayed by a stall."""
    stall_s: tuple[float, float] = (0.05, 0.3)
    """Shortest and longest stall [s]; later samples arrive at its end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """A block of samples that arrived at once."""

    first: int
    """Index of the block's first sample among those that arrived."""
    count: int
    arrival_s: float
    """Arrival time [s] after the instant of the stream's first sample."""


class DeliveredStream:
    """Arrivals of a stream, and the true times of its samples.

    `delivery`: properties of the radio and its connection.
    `duration_s`: length of the stream [s].
    `rng`: random generator.
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
        """Indices, among the samples that arrived, before which some are missing."""
        self.gap = gap
        """Number of samples in each loss."""
        self.samples = self._samples - gap * len(self.losses)
        """Number of samples that arrived."""

    @property
    def lost(self) -> int:
        """Number of lost samples."""
        return self.gap * len(self.losses)

    def true_s(self, index: int) -> float:
        """True time of a sample [s], by its index among those that arrived."""
        missing = int(np.searchsorted(self.losses, index, side="right"))
        return (index + self.gap * missing) / self.true_rate_hz

    def since_loss_s(self, index: int) -> float:
        """Time of a sample after the end of the last loss [s]; infinite before the
        first loss.
        """
        at = int(np.searchsorted(self.losses, index, side="right")) - 1
        if at < 0:
            return math.inf
        return (index - int(self.losses[at])) / self.true_rate_hz

    def transfers(self) -> Iterator[Transfer]:
        """Blocks in order of their arrival."""
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
