"""Hills of the simulated world: heights of the ground, and their diffraction loss.

Heights come from elevation files or a function. The loss is that of Bullington in
Recommendation ITU-R P.526-15 (§4.5.1), with exact Fresnel integrals, minus the loss over level
ground, which the reflected ray represents.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.terrain.elevation_files import open_elevation
from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.record import ScenarioRecord

_Floats = NDArray[np.float64]
Heights = Callable[[_Floats, _Floats], _Floats]
"""Function that returns the height of the ground [m], in any datum, at metres north and east of
home."""
_STEP_M = 10.0
_CLOSE_POINTS = 100
_EARTH_M = 4.0 / 3.0 * 6_371_000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Terrain(ScenarioRecord):
    """Settings of a scenario for ground with hills."""

    dem: str | None = None
    """Path of an elevation file, or of a folder of such files. Flight heights are then relative
    to the ground at home, and heights of tags to the ground beneath them."""
    sea: bool = False
    """True to treat areas outside the elevation files as water at height 0."""


class Relief:
    """Computes heights of the ground above that at home, and losses by hills."""

    def __init__(self, heights: Heights) -> None:
        self._heights = heights
        self._home_m = float(heights(np.zeros(1), np.zeros(1))[0])

    @classmethod
    def of_files(cls, terrain: Terrain, plane: geometry.TangentPlane) -> "Relief | None":
        """Open elevation files; None if no files are given.

        Raises `FormatError` if a file cannot be read.
        """
        if terrain.dem is None:
            return None
        elevation = open_elevation(Path(terrain.dem), sea=terrain.sea)

        def heights(north_m: _Floats, east_m: _Floats) -> _Floats:
            places = [
                plane.to_geodetic(float(north), float(east))
                for north, east in zip(north_m, east_m, strict=True)
            ]
            found = elevation.heights_m([one[0] for one in places], [one[1] for one in places])
            # A void takes the height of its neighbour along the path.
            known = np.isfinite(found)
            at = np.arange(len(found))
            return np.interp(at, at[known], found[known]) if known.any() else np.zeros(len(at))

        return cls(heights)

    def height_m(self, north_m: float, east_m: float) -> float:
        """Height of the ground above that at home [m]."""
        return float(self._heights(np.array([north_m]), np.array([east_m]))[0]) - self._home_m

    def loss_db(
        self, drone: geometry.Vector, tag: geometry.Vector, wavelength_m: float
    ) -> float:
        """Diffraction loss between drone and tag, beyond that of level ground [dB]."""
        far = math.hypot(tag[0] - drone[0], tag[1] - drone[1])
        if far < 2.0 * _STEP_M:
            return 0.0
        share = np.linspace(0.0, 1.0, max(3, math.ceil(far / _STEP_M) + 1))
        north = drone[0] + (tag[0] - drone[0]) * share
        east = drone[1] + (tag[1] - drone[1]) * share
        ground = self._heights(north, east) - self._home_m
        over_drone, over_tag = -drone[2] - ground[0], -tag[2] - ground[-1]
        x = far * share
        curved = ground + x * (far - x) / (2.0 * _EARTH_M)
        ends = (-drone[2], -tag[2])
        level = (max(over_drone, 0.1), max(over_tag, 0.1))
        loss = _bullington_db(x, curved, ends, wavelength_m)
        # Level ground rises most into a low tag's ray within a few metres of the tag.
        close = np.geomspace(0.01, 0.5 * far, _CLOSE_POINTS)
        level_x = np.concatenate(([0.0], close[:-1], (far - close)[::-1], [far]))
        return max(
            0.0, loss - _bullington_db(level_x, np.zeros_like(level_x), level, wavelength_m)
        )


def _bullington_db(
    x: _Floats, ground: _Floats, ends: tuple[float, float], wavelength_m: float
) -> float:
    far, between, height = float(x[-1]), x[1:-1], ground[1:-1]
    start, end = ends
    up = float(np.max((height - start) / between))
    if up < (end - start) / far:
        ray = start + (end - start) * between / far
        over, at = height - ray, between
    else:
        back = float(np.max((height - end) / (far - between)))
        meeting = (end - start + back * far) / (up + back)
        meeting = min(max(meeting, 1e-3 * far), 0.999 * far)
        at = np.array([meeting])
        over = np.array([start + up * meeting - start - (end - start) * meeting / far])
    nu = float(np.max(over * np.sqrt(2.0 * far / (wavelength_m * at * (far - at)))))
    if nu <= -0.78:
        return 0.0
    s, c = special.fresnel(nu)
    edge = max(0.0, -10.0 * math.log10(((0.5 - c) ** 2 + (0.5 - s) ** 2) / 2.0))
    return edge + (1.0 - math.exp(-edge / 6.0)) * (10.0 + 2e-5 * far)
