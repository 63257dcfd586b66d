"""Strengths of receivers that never turned: one level for each place and heading."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strengths:
    """One receiver's levels of a tag, received without turning."""

    listener: str
    """Name of the receiver, for the operator: ``vehicle 7`` or a flight's name."""
    pulses: int
    """Number of pulses in the levels, used or not."""
    latitude_deg: _Floats
    """(n,) places of the receiver."""
    longitude_deg: _Floats
    height_m: _Floats
    yaw_deg: _Floats
    """(n,) headings of the boresight."""
    level_db: _Floats
    """(n,) received SNR, including the antenna's gain towards the tag."""
    sigma_db: _Floats
    antenna: AntennaPattern | None
    """None is an upright monopole."""
    unused: str | None = None
    """Why none of it can be used."""

    def because(self, reason: str) -> str:
        """Sentence that it is not used, and why."""
        return f"{self.listener}: its strengths ({self.pulses} pulses) are not used: {reason}"

    @property
    def outcome(self) -> str:
        """Sentence for the operator on its use."""
        if self.unused is not None:
            return self.because(self.unused)
        stood = "one place" if len(self.level_db) == 1 else f"{len(self.level_db)} places"
        return f"{self.listener}: the strengths of {self.pulses} pulses, at {stood}, went in"
