"""Losses behind hills of a flight's pulses, from each place."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.tuning import POWER
from uavrt.terrain.hill_losses import HillLosses, LossesFrom

_Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OverHills:
    """The ground, and its losses from a flight's pulses."""

    hills: HillLosses
    losses: LossesFrom
    factor: float = 1.0
    """Factor on the computed losses."""

    @classmethod
    def of(
        cls, hills: HillLosses | None, east_m: _Floats, north_m: _Floats, up_m: _Floats
    ) -> "OverHills | None":
        """Losses from each pulse's place, its height above the ground at the take-off.

        `hills`: in the plane of the places; None is level ground.
        `east_m`, `north_m`, `up_m`: shape (n,).
        """
        if hills is None:
            return None
        return cls(hills=hills, losses=hills.seen_from(east_m, north_m, up_m))

    def lost_db(self, east_m: _Floats, north_m: _Floats) -> NDArray[np.float32]:
        """(places, n) losses [dB] of the pulses from places (places,)."""
        return self.losses(east_m, north_m) * np.float32(self.factor)

    def chosen(self, pulses: NDArray[np.bool_] | NDArray[np.intp]) -> "OverHills":
        """Losses of some of the pulses."""
        return replace(self, losses=replace(self.losses, which=self.losses.which[pulses]))


def along_error_db(lost_db: _Floats) -> float:
    """Standard deviation of the errors of losses (n,) along a path, common error excluded."""
    hidden = float(np.mean(lost_db > POWER.hidden_db))
    return float(np.hypot(POWER.hill_error * np.std(lost_db), POWER.map_error_db * hidden**0.5))
