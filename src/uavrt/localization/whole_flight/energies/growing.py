"""Measure the energies of time slots during a flight; each half minute is measured once and
stored.

The energies equal those computed from a whole recording: each block is measured with its
neighbours on both sides, and standardised together with all others.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.number_kinds import Resolution
from uavrt.localization.whole_flight.energies.energy_grid import (
    SlotEnergies,
    joined,
    slot_energies,
    slot_layout,
)
from uavrt.localization.whole_flight.tuning import ENERGY


class GrowingEnergies:
    """Converts a channel's samples, as they arrive during a flight, to the energies of all time
    slots.
    """

    def __init__(
        self,
        tag: Tag,
        *,
        start_ns: int,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequency_window_hz: float,
        slots_per_pulse: Resolution[int] = 2,
    ) -> None:
        self._tag, self._start_ns = tag, start_ns
        self._rate_hz, self._center_hz = sample_rate_hz, center_frequency_hz
        self._window_hz, self._slots_per_pulse = frequency_window_hz, slots_per_pulse
        layout = slot_layout(
            tag,
            sample_rate_hz=sample_rate_hz,
            center_frequency_hz=center_frequency_hz,
            frequency_window_hz=frequency_window_hz,
            slots_per_pulse=slots_per_pulse,
        )
        self._slot = layout.samples_per_slot
        slot_s = self._slot / sample_rate_hz
        self._block = max(1, round(ENERGY.block_s / slot_s))
        self._margin = layout.slots_beside
        self._parts: list[SlotEnergies] = []

    @property
    def needed_from_ns(self) -> int:
        """Time from which samples are still needed for the next block [ns, UTC]."""
        first = max(0, len(self._parts) * self._block - self._margin) * self._slot
        return self._start_ns + math.floor(first / self._rate_hz * NANOSECONDS_PER_SECOND)

    @property
    def length_s(self) -> float:
        """Duration of the flight measured so far [s]."""
        return len(self._parts) * self._block * self._slot / self._rate_hz

    def take(
        self, samples: NDArray[np.complex64], there: NDArray[np.bool_], start_ns: int
    ) -> int:
        """Measure the blocks that are now complete; return their number.

        The samples are results of `gather` and begin at or before `needed_from_ns`; samples
        missing before the first one count as gaps.
        """
        since_s = (start_ns - self._start_ns) / NANOSECONDS_PER_SECOND
        offset = round(since_s * self._rate_hz)
        before = len(self._parts)
        while True:
            number = len(self._parts)
            low = (number * self._block - self._margin) * self._slot - offset
            high = ((number + 1) * self._block + self._margin) * self._slot - offset
            if high > len(samples):
                return number - before
            block = np.zeros(high - low, np.complex64)
            known = np.zeros(high - low, np.bool_)
            first = max(low, 0)
            if first < high:
                block[first - low :] = samples[first:high]
                known[first - low :] = there[first:high]
            self._parts.append(self._measured(block, known, low + offset))

    def _measured(
        self, samples: NDArray[np.complex64], there: NDArray[np.bool_], index: int
    ) -> SlotEnergies:
        start_s = index / self._rate_hz
        energies = slot_energies(
            samples,
            there,
            tag=self._tag,
            start_ns=self._start_ns + round(start_s * NANOSECONDS_PER_SECOND),
            sample_rate_hz=self._rate_hz,
            center_frequency_hz=self._center_hz,
            frequency_window_hz=self._window_hz,
            slots_per_pulse=self._slots_per_pulse,
        )
        return energies.between(self._margin, self._margin + self._block)

    def energies(self) -> SlotEnergies:
        """Return the energies of all blocks. Raises `ValueError` if there are none."""
        return joined(self._parts)
