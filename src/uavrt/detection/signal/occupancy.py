"""Measure the share of time in which a tag's frequency is free of other signals.

An instant is occupied if its power exceeds that of the quiet instants at this frequency. A
steady transmitter leaves no quiet instant, so every instant is also compared with the quietest
frequencies of the channel.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.signal.tuning import OCCUPANCY


class Occupancy:
    """Counts the instants, one pulse long, in which a frequency is free of other signals."""

    def __init__(
        self, *, sample_rate_hz: float, pulse_width_s: float, offset_hz: float
    ) -> None:
        self._length = max(4, round(pulse_width_s * sample_rate_hz))
        self._length_s = self._length / sample_rate_hz
        bin_hz = sample_rate_hz / self._length
        offsets = offset_hz + OCCUPANCY.apart_bins * bin_hz * np.array([-1.0, 0.0, 1.0])
        turn = np.arange(self._length)[:, np.newaxis] * offsets / sample_rate_hz
        # Side lobes would show a neighbouring signal.
        self._taper = np.hanning(self._length + 2)[1:-1].astype(np.float32)
        self._filters = (self._taper[:, np.newaxis] * np.exp(-2j * np.pi * turn)).astype(
            np.complex64
        )
        self._quiet = math.inf
        self._usable = self._looked = self._calls = 0

    def count(self, samples: NDArray[np.complex64]) -> None:
        """Count free instants in samples without their carriers; lost samples are zero."""
        count = len(samples) // self._length
        if not count:
            return
        windows = samples[: count * self._length].reshape(count, self._length)
        present = windows[:, :: OCCUPANCY.stride] != 0.0
        received: NDArray[np.float64] | np.float64 = np.float64(1.0)
        if not present.all():
            share = present.mean(axis=1)
            enough = share > OCCUPANCY.least_received
            windows, received = windows[enough], share[enough]
            if not len(windows):
                return
        cells = windows @ self._filters
        power = (cells.real**2 + cells.imag**2).mean(axis=1) / received
        risen = self._quiet * math.exp(count * self._length_s / OCCUPANCY.rise_s)
        own = float(np.partition(power, len(power) // 4)[len(power) // 4])
        self._quiet = min(risen, own)
        if self._calls % OCCUPANCY.channel_every == 0:
            self._quiet = min(self._quiet, OCCUPANCY.above_channel * self._lowest(windows))
        self._calls += 1
        self._usable += int(np.count_nonzero(power < OCCUPANCY.loud_ratio * self._quiet))
        self._looked += len(power)

    def _lowest(self, windows: NDArray[np.complex64]) -> float:
        """Power of the channel's quietest frequencies in the quietest quarter of the time."""
        spectrum = np.fft.fft(windows * self._taper)
        power = spectrum.real**2 + spectrum.imag**2
        quiet = np.partition(power, len(power) // 4, axis=0)[len(power) // 4]
        groups = max(len(quiet) // OCCUPANCY.group_bins, 1)
        return float(
            quiet[: groups * OCCUPANCY.group_bins].reshape(groups, -1).mean(axis=1).min()
        )

    def take_share(self) -> float | None:
        """Share of free instants since the last call; None: all samples were lost."""
        share = self._usable / self._looked if self._looked else None
        self._usable = self._looked = 0
        return share
