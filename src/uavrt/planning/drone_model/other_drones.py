"""Paths of the other drones in the same search, and their distances from this drone's paths.

The straight path from a drone's last reported position to its goal is reserved for that
drone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import ConfigError
from uavrt.planning.area import segment_distance_m
from uavrt.planning.drone_model.drone_motion import Legs, Path
from uavrt.planning.tuning import PLANNING

_Floats = NDArray[np.float64]
Strip = tuple[tuple[float, float], tuple[float, float]]
"""Start and end of a drone's straight path, each as east and north [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """Minimum distances between drones: over ground, with a margin for planning, and in
    height.
    """

    distance_m: float = 25.0
    height_m: float = 10.0
    margin: float = 1.2

    def __post_init__(self) -> None:
        if min(self.distance_m, self.height_m) <= 0.0 or self.margin < 1.0:
            raise ConfigError(
                f"invalid distance between drones: {self.distance_m:g} m, height difference "
                f"{self.height_m:g} m, margin {self.margin:g}",
                remedy="Give distances above 0 and a margin of 1 or more",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherDrones:
    """Paths and tags of the other drones in a search, as known before a decision."""

    separation: Separation
    listening: tuple[Path, ...] = ()
    """Planned paths of other drones that report pulses; information that they will gain is not
    counted again."""
    left: frozenset[int] = frozenset()
    """Ids of the tags that other drones search for and this drone therefore skips."""
    strips: tuple[Strip, ...] = ()
    """Straight paths of other drones. Each is reserved at all times, because the drones' clocks
    are not synchronised."""

    def strip_distance_m(
        self, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """Shortest distance of each candidate path from other drones' paths [m], shape
        (paths,).
        """
        least = np.full(len(east_m), np.inf)
        for one in self.strips:
            least = np.minimum(least, segment_distance_m(start_m, (east_m, north_m), one))
        return least

    def legs(self, time_s: float) -> Legs | None:
        """Sample the remaining paths of the other drones that report pulses; None if there are
        none.
        """
        if not self.listening:
            return None
        shares = (np.arange(PLANNING.drones_samples) + 0.5) / PLANNING.drones_samples
        left = np.array(
            [max(PLANNING.drones_span_s, one.time_s[-1] - time_s) for one in self.listening]
        )
        times = left[:, None] * shares
        places = [
            _places_at(one, time_s + row)
            for one, row in zip(self.listening, times, strict=True)
        ]
        yaw = [
            np.interp(time_s + row, one.time_s, np.unwrap(one.yaw_deg, period=360.0))
            for one, row in zip(self.listening, times, strict=True)
        ]
        return Legs(
            duration_s=left,
            time_s=times,
            east_m=np.array([east for east, _ in places]),
            north_m=np.array([north for _, north in places]),
            yaw_deg=np.array(yaw),
        )


def _places_at(path: Path, time_s: _Floats) -> tuple[_Floats, _Floats]:
    return (
        np.interp(time_s, path.time_s, path.east_m),
        np.interp(time_s, path.time_s, path.north_m),
    )
