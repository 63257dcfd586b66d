"""Model losses by the ground between drone and tag, and the uncertainty of these losses.

Level ground has shadowing, for example by plants, and reflects; hills have losses computed
from an elevation map. `effect` is for single pulses, `along` for whole paths of the drone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.levels.ground_reflection import ReflectionShapes
from uavrt.localization.position.levels.level_belief import GroundEffect, Listening
from uavrt.localization.position.levels.loss_error import doubtful_db
from uavrt.localization.position.tuning import LOSS, LastingError
from uavrt.localization.terrain.hill_losses import HillLosses

_Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelGround:
    """Level ground with shadowing and an unknown reflection."""

    shadowing_db: float
    """Standard deviation of the shadowing [dB]; 0: none."""
    reflection: ReflectionShapes | None = None
    """Unknown reflection; None: none."""

    @property
    def lasting_error(self) -> LastingError | None:
        """Constants of the shadowing; None without shadowing."""
        return LOSS.shadowing if self.shadowing_db > 0.0 else None

    @property
    def _everywhere(self) -> GroundEffect:
        return GroundEffect(doubtful_db=self.shadowing_db or None, reflection=self.reflection)

    def effect(self, heard: Listening, east_m: _Floats, north_m: _Floats) -> GroundEffect:
        """Effect of the ground on a pulse of a tag at each position."""
        return self._everywhere

    def along(
        self, east_m: _Floats, north_m: _Floats, dx: _Floats, dy: _Floats, height_m: float
    ) -> GroundEffect:
        """Effect of the ground along paths, for tags at distances (dx, dy) from the drone."""
        return self._everywhere


@dataclass(frozen=True, slots=True, kw_only=True)
class HillyGround:
    """Model of hilly ground with losses computed from an elevation map."""

    hills: HillLosses
    reflection: None = None
    """None: the losses behind hills are less certain than any reflection."""

    @property
    def lasting_error(self) -> LastingError:
        """Constants of the relative error of computed losses behind hills."""
        return LOSS.hills

    def effect(self, heard: Listening, east_m: _Floats, north_m: _Floats) -> GroundEffect:
        """Effect of the ground on a pulse, for a tag at each position."""
        hills = self.hills
        drone = float(heard.east_m), float(heard.north_m), float(heard.height_m) + hills.tag_m
        lost = hills.loss_db(drone, east_m, north_m).astype(east_m.dtype)
        return GroundEffect(
            rise_m=hills.rise_m(east_m, north_m).astype(east_m.dtype),
            lost_db=lost,
            doubtful_db=doubtful_db(lost),
        )

    def along(
        self, east_m: _Floats, north_m: _Floats, dx: _Floats, dy: _Floats, height_m: float
    ) -> GroundEffect:
        """Effect of the ground along paths, for tags at distances (dx, dy) from the drone.

        A coarse version of the elevation map is used, so that many paths can be computed
        quickly.
        """
        hills = self.hills.rough()
        up = np.full(east_m.shape, height_m)
        seen = hills.seen_from(east_m.ravel(), north_m.ravel(), up.ravel() + hills.tag_m)
        tag_east, tag_north = east_m + dx, north_m + dy
        lost = seen.between(seen.which.reshape(east_m.shape), tag_east, tag_north)
        # Differences within a coarse square are unknown: hypotheses in it lose the same.
        apart2 = float(np.mean(dx.var(axis=2) + dy.var(axis=2)))
        share = np.float32(apart2 / (apart2 + (2.0 * seen.cell_m) ** 2))
        lost = share * lost + (1.0 - share) * lost.mean(axis=2, keepdims=True)
        rise = hills.rise_m(tag_east, tag_north).astype(np.float32)
        return GroundEffect(rise_m=rise, lost_db=lost, doubtful_db=doubtful_db(lost))


GroundModel = LevelGround | HillyGround
