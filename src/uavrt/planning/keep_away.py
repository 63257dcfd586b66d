"""Compute the probability that paths keep a minimum distance from animals."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import ConfigError
from uavrt.planning.beliefs import Beliefs

_Floats = NDArray[np.float64]
_Real = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepAway:
    """Minimum distance of paths from every tag, found or not.

    When planning, the distance is multiplied by `margin`, as an animal may move.
    """

    radius_m: float = 50.0
    probability: float = 0.95
    margin: float = 1.25
    hypotheses: int = 200

    def __post_init__(self) -> None:
        if self.radius_m <= 0.0 or not 0.0 < self.probability < 1.0 or self.margin < 1.0:
            raise ConfigError(
                f"invalid distance to animals: {self.radius_m:g} m, probability "
                f"{self.probability:g}, margin {self.margin:g}",
                remedy="Give a radius above 0, a probability below 1, a margin of 1 or more",
            )

    def kept(
        self,
        beliefs: Beliefs,
        start_m: tuple[float, float],
        east_m: _Floats,
        north_m: _Floats,
        *,
        speed_m_s: float,
        stays_s: float = 0.0,
    ) -> _Floats:
        """Probability that each path, with a stay at its end, keeps the distance from each tag,
        shape (tags, paths).
        """
        out = np.empty((len(beliefs), len(east_m)))
        limit = (self.margin * self.radius_m) ** 2
        way_x, way_y = east_m - start_m[0], north_m - start_m[1]
        span = np.hypot(way_x, way_y) / speed_m_s
        speed_x, speed_y = (way / np.maximum(span, 1e-6) for way in (way_x, way_y))
        for number, belief in enumerate(beliefs.values()):
            some = belief.hypotheses(self.hypotheses)
            x = (some.east_m - start_m[0])[:, None]
            y = (some.north_m - start_m[1])[:, None]
            goes_x, goes_y = some.east_m_s[:, None], some.north_m_s[:, None]
            off = _nearest_m2(x, y, goes_x - speed_x, goes_y - speed_y, span)
            if stays_s > 0.0:
                x, y = x + goes_x * span - way_x, y + goes_y * span - way_y
                off = np.minimum(off, _nearest_m2(x, y, goes_x, goes_y, stays_s))
            out[number] = np.mean(off > limit, axis=0)
        return out


def _nearest_m2(
    x: _Real, y: _Real, speed_x: _Real, speed_y: _Real, span_s: _Real | float
) -> _Floats:
    """Square of the shortest distance from the origin during a motion at constant velocity
    [m²].
    """
    speed2 = np.maximum(speed_x**2 + speed_y**2, 1e-9)
    time = np.clip(-(x * speed_x + y * speed_y) / speed2, 0.0, span_s)
    return np.asarray((x + speed_x * time) ** 2 + (y + speed_y * time) ** 2)
