"""Slot energies of a flight that goes on: each half minute's are measured once, then kept.

They are as good as those of a whole recording: a block is measured with its neighbours on both
sides, and brought to mean 0 and variance 1 together with all others.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.integration.energy_grid import SlotEnergies, joined, slot_energies, slot_layout
from uavrt.messages import Tag
from uavrt.units import NANOSECONDS_PER_SECOND

BLOCK_S = 30.0
"""How much is measured at once: five stretches of one noise level."""


class GrowingEnergies:
    """Takes a channel's samples as they come; gives the energies of all that came.

    `start_ns`: time of the first sample [UTC].
    `frequency_window_hz`: half-width of the search around the tag's nominal frequency.
    `slots_per_pulse`: 1 is a quarter of the folding of 2.
    """

    def __init__(
        self,
        tag: Tag,
        *,
        start_ns: int,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequency_window_hz: float,
        slots_per_pulse: int = 2,
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
        self._block = max(1, round(BLOCK_S / slot_s))
        self._beside = layout.slots_beside
        self._parts: list[SlotEnergies] = []

    @property
    def needed_from_ns(self) -> int:
        """Time from which samples are needed for the next block; those before are not."""
        first = max(0, len(self._parts) * self._block - self._beside) * self._slot
        return self._start_ns + math.floor(first / self._rate_hz * NANOSECONDS_PER_SECOND)

    @property
    def length_s(self) -> float:
        """How much has been measured."""
        return len(self._parts) * self._block * self._slot / self._rate_hz

    def take(
        self, samples: NDArray[np.complex64], there: NDArray[np.bool_], start_ns: int
    ) -> int:
        """Measure the blocks that are whole now; get how many.

        `samples`, `there`, `start_ns`: from `gather`, beginning at or before `needed_from_ns`;
        what is missing before the first of them counts as not heard.
        """
        since_s = (start_ns - self._start_ns) / NANOSECONDS_PER_SECOND
        offset = round(since_s * self._rate_hz)
        before = len(self._parts)
        while True:
            number = len(self._parts)
            low = (number * self._block - self._beside) * self._slot - offset
            high = ((number + 1) * self._block + self._beside) * self._slot - offset
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
        return energies.between(self._beside, self._beside + self._block)

    def energies(self) -> SlotEnergies:
        """Get those of all blocks.

        Raises `ValueError`: there is none yet.
        """
        return joined(self._parts)
