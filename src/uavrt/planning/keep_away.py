"""Keep animals undisturbed: ways that stay far enough from where they may be."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import ConfigError
from uavrt.planning.beliefs import Beliefs

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepAway:
    """A radius around every tag, found or not, and how surely it is kept.

    Parameters
    ----------
    radius_m : float
        Distance over ground that is not to be gone below.
    probability : float
        That a way keeps it, for each tag.
    margin : float
        Factor on the radius when planning: an animal walks meanwhile.
    hypotheses : int
        Drawn of each tag.
    """

    radius_m: float = 50.0
    probability: float = 0.95
    margin: float = 1.25
    hypotheses: int = 200

    def __post_init__(self) -> None:
        if self.radius_m <= 0.0 or not 0.0 < self.probability < 1.0 or self.margin < 1.0:
            raise ConfigError(
                f"keeping {self.radius_m:g} m away with a probability of {self.probability:g} "
                f"and a margin of {self.margin:g}",
                remedy="Give a radius above 0, a probability below 1, a margin of 1 or more",
            )

    def kept(
        self, beliefs: Beliefs, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """(tags, ways) probability that straight ways keep the planned distance of each tag.

        A tag that may not exist is counted as if it did.
        """
        out = np.empty((len(beliefs), len(east_m)))
        limit = (self.margin * self.radius_m) ** 2
        way_x, way_y = east_m - start_m[0], north_m - start_m[1]
        length2 = np.maximum(way_x**2 + way_y**2, 1e-9)
        for number, belief in enumerate(beliefs.values()):
            some = belief.hypotheses(self.hypotheses)
            x = (some.east_m - start_m[0])[:, None]
            y = (some.north_m - start_m[1])[:, None]
            share = np.clip((x * way_x + y * way_y) / length2, 0.0, 1.0)
            off = (x - share * way_x) ** 2 + (y - share * way_y) ** 2
            out[number] = np.mean(off > limit, axis=0)
        return out
