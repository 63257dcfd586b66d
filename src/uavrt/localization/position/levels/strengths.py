"""Signal levels of a tag at a receiver that never turned, one for each position and heading."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strengths:
    """Signal levels of a tag at one receiver that never turned."""

    listener: str
    """Name of the receiver as shown to the operator: ``vehicle 7`` or a flight's name."""
    pulses: int
    """Number of received pulses from which the levels were computed, whether used or not."""
    latitude_deg: _Floats
    """Latitude of the receiver at each level [deg], shape (n,)."""
    longitude_deg: _Floats
    height_m: _Floats
    yaw_deg: _Floats
    """Direction of the boresight at each level, clockwise from true north [deg], shape (n,)."""
    level_db: _Floats
    """Received SNR including the antenna's gain towards the tag [dB], shape (n,)."""
    sigma_db: _Floats
    antenna: AntennaPattern | None
    """Antenna pattern; None for an upright monopole."""
    unused: str | None = None
    """Reason why none of the levels can be used; None if they can."""

    def because(self, reason: str) -> str:
        """Sentence for the operator that states why the levels are not used."""
        return f"{self.listener}: strengths of {self.pulses} pulses are not used: {reason}"

    @property
    def outcome(self) -> str:
        """Sentence for the operator that states whether the levels were used."""
        if self.unused is not None:
            return self.because(self.unused)
        stood = "one place" if len(self.level_db) == 1 else f"{len(self.level_db)} places"
        return (
            f"{self.listener}: the strengths of {self.pulses} pulses, received at {stood}, "
            "were used"
        )
