"""Compute losses behind hills for a flight's pulses, for each possible position of the tag."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.number_kinds import Fixed
from uavrt.localization.position.levels.loss_error import doubtful_db
from uavrt.localization.position.tuning import POWER
from uavrt.localization.terrain.hill_losses import HillLosses, LossesFrom

_Floats = NDArray[np.floating[Any]]
HILL_FACTORS = (
    (1.0 - 3.0**0.5 * POWER.hill_error, 1.0 / 6.0),
    (1.0, 2.0 / 3.0),
    (1.0 + 3.0**0.5 * POWER.hill_error, 1.0 / 6.0),
)
"""Candidate factors on all losses behind hills, with their probabilities, by Gauss-Hermite
quadrature."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackHillLosses:
    """Losses behind hills of the pulses along a track, computed by a ground model."""

    hills: HillLosses
    losses: LossesFrom
    factor: Fixed[float] = 1.0
    """Factor on the losses behind hills that are computed from the terrain."""

    @classmethod
    def of(
        cls, hills: HillLosses | None, east_m: _Floats, north_m: _Floats, up_m: _Floats
    ) -> "TrackHillLosses | None":
        """Return losses for pulses received at positions; heights are relative to the ground at
        the take-off.
        """
        if hills is None:
            return None
        return cls(hills=hills, losses=hills.seen_from(east_m, north_m, up_m))

    def lost_db(self, east_m: _Floats, north_m: _Floats) -> NDArray[np.float32]:
        """Loss of each pulse for a tag at each position [dB], shape (places, n)."""
        return self.losses(east_m, north_m) * np.float32(self.factor)

    def chosen(self, pulses: NDArray[np.bool_] | NDArray[np.intp]) -> "TrackHillLosses":
        """Return the losses of the pulses that an index array or a mask selects."""
        return replace(self, losses=replace(self.losses, which=self.losses.which[pulses]))


def track_error_db(lost_db: _Floats) -> float:
    """Standard deviation of the errors of losses (n,), without the error common to all [dB]."""
    return float(POWER.hill_error * np.std(doubtful_db(lost_db)))
