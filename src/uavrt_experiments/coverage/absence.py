"""Silence over hills: of areas said to be empty with .95, how many are?

Tags lie anywhere on the map alike, and their levels are off as the map believes them to be. The
simulated world, which has its own propagation, says how strong each pulse comes; whether a
group is found is drawn with the detector's own probability. For each tag that was not heard, an
area is drawn of those that the map says to be empty with .94 to .96.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.detection import detection_probability
from uavrt.messages import Tag
from uavrt.planning import Coverage, LinkBudget, absence, coverage_of, listening_way
from uavrt.simulation import Antenna, Flight, Leg, Propagation, Scenario, SimulatedTag, World
from uavrt.tangent_plane import TangentPlane
from uavrt.terrain import GroundGrid
from uavrt_experiments.result import Row
from uavrt_experiments.search import Hills
from uavrt_experiments.statistics import wilson_interval

_Floats = NDArray[np.float64]
_HALF_M = 1500.0
_CELL_M = 30.0
_HEIGHT_M = 60.0
_SPEED_M_S = 18.0
_SIGMA_DB = 3.0
_EIRP_DBM = -63.0
_SAID = (0.94, 0.96)
_AREAS = 100
_TRIED = 60_000
_TAG = Tag(
    tag_id=1,
    frequency_hz=150e6,
    pulse_width_s=0.02,
    pulse_intervals_s=(1.254,),
    interval_uncertainty_s=0.06,
    interval_jitter_s=0.01,
    k=3,
)


def absence_row(
    silent: int, *, worlds: int = 4, seed: int = 1, on_tag: Callable[[int], None] | None = None
) -> Row:
    """Count how many areas that are said to be empty with .94 to .96 are.

    Parameters
    ----------
    silent : int
        Tags that are not heard, over all worlds.
    worlds : int
        Different hills and flights.
    seed : int
    on_tag : callable, optional
        Takes how many silent tags there have been.
    """
    empty = done = 0
    for number in range(worlds):
        rng = np.random.default_rng((seed, number))
        world = _HillyWorld(rng)
        wanted = silent * (number + 1) // worlds
        while done < wanted:
            east, north = rng.uniform(-_HALF_M, _HALF_M, 2)
            if world.hears(east, north, float(rng.normal(0.0, _SIGMA_DB)), rng):
                continue
            west, right, south, top = world.areas[rng.integers(len(world.areas))]
            empty += not (west <= east <= right and south <= north <= top)
            done += 1
            if on_tag is not None:
                on_tag(done)
    low, high = wilson_interval(empty, done)
    return Row(
        experiment="C1",
        quantity="share of areas said to be empty with .94 to .96 that are",
        case=f"{worlds} flights over hills, ± {_SIGMA_DB:g} dB",
        figure=empty / done,
        low=low,
        high=high,
        n=done,
        least=0.93,
        most=0.97,
    )


class _HillyWorld:
    """Hills, a flight over them, its map, and areas of which the map is fairly sure."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._hills = Hills(seed=int(rng.integers(1 << 30)), relief_m=120.0)
        axis = np.arange(-_HALF_M, _HALF_M + 1.0, _CELL_M)
        height = self._hills(*np.meshgrid(axis, axis))
        ground = GroundGrid(
            plane=TangentPlane(latitude_deg=47.0, longitude_deg=8.0),
            west_m=-_HALF_M,
            south_m=-_HALF_M,
            cell_m=_CELL_M,
            known=np.ones(height.shape, bool),
            height_m=height.astype(np.float32),
        )
        self._corners = [
            (float(east), float(north)) for east, north in rng.uniform(-900.0, 900.0, (4, 2))
        ]
        # The drone holds its height over home; the map must know how high that is each time.
        way = listening_way(
            self._corners, height_m=_HEIGHT_M, speed_m_s=_SPEED_M_S, interval_s=1.254
        )
        start = float(self._hills(np.zeros(1), np.zeros(1))[0])
        above = start + self._amsl(height, start) - ground(way.east_m, way.north_m)
        self._way = replace(way, height_m=above)
        budget = LinkBudget(
            frequency_hz=_TAG.frequency_hz,
            pulse_width_s=_TAG.pulse_width_s,
            tag_eirp_dbm=_EIRP_DBM,
            drone_height_m=_HEIGHT_M,
            mismatch_db=0.0,
        )
        self._flown_m = self._amsl(height, start)
        self.map = coverage_of(ground, self._way, _TAG, budget, level_sigma_db=_SIGMA_DB)
        self.areas = _areas(self.map, rng)

    @staticmethod
    def _amsl(height: _Floats, start: float) -> float:
        """Height over home at which the drone clears all hills."""
        return float(height.max()) - start + 0.5 * _HEIGHT_M

    def hears(
        self, east_m: float, north_m: float, error_db: float, rng: np.random.Generator
    ) -> bool:
        """Whether a flight hears a tag, by the simulated world's levels of its pulses."""
        world = World(
            self._scenario(east_m, north_m, error_db),
            ground=lambda north, east: self._hills(east, north),
        )
        tag = world.scenario.tag[0]
        for first in range(0, len(self._way.time_s) - _TAG.k + 1, _TAG.k):
            pulses = [world.pulse(tag, first + number).enr_db for number in range(_TAG.k)]
            mean = 10.0 * np.log10(np.mean(10.0 ** (np.array(pulses) / 10.0)))
            # In steps of a tenth: the chances are kept.
            if rng.random() < detection_probability(_TAG, round(max(float(mean), -15.0), 1)):
                return True
        return False

    def _scenario(self, east_m: float, north_m: float, error_db: float) -> Scenario:
        (first_east, first_north), *rest = self._corners
        legs, at = [], (first_east, first_north)
        for east, north in rest:
            way_m = float(np.hypot(east - at[0], north - at[1]))
            legs.append(Leg(duration_s=way_m / _SPEED_M_S, north_m=north, east_m=east))
            at = (east, north)
        flight = Flight(
            north_m=first_north,
            east_m=first_east,
            height_m=self._flown_m,
            wobble_deg=0.0,
            leg=tuple(legs),
        )
        tag = SimulatedTag(
            tag_id=1,
            frequency_hz=_TAG.frequency_hz,
            pulse_width_s=_TAG.pulse_width_s,
            pulse_intervals_s=_TAG.pulse_intervals_s,
            north_m=north_m,
            east_m=east_m,
            erp_dbm=_EIRP_DBM + error_db,
            first_pulse_s=0.0,
        )
        return Scenario(
            antenna=Antenna(pattern="isotropic", gain_dbi=4.0, polarization="any"),
            propagation=Propagation(model="two_ray", doppler=False),
            flight=flight,
            tag=(tag,),
        )


def _areas(
    found: Coverage, rng: np.random.Generator
) -> list[tuple[float, float, float, float]]:
    """West, east, south and north of rectangles that are probably empty, after silence."""
    ground = found.ground
    areas: list[tuple[float, float, float, float]] = []
    for _ in range(_TRIED):
        middle = rng.uniform(-_HALF_M, _HALF_M, 2)
        half = rng.uniform(100.0, 900.0, 2)
        low, high = np.maximum(middle - half, -_HALF_M), np.minimum(middle + half, _HALF_M)
        inside = (ground.east_m >= low[0]) & (ground.east_m <= high[0])
        cells = (
            inside[np.newaxis, :]
            & ((ground.north_m >= low[1]) & (ground.north_m <= high[1]))[:, np.newaxis]
        )
        if cells.any() and _SAID[0] <= absence(found, cells, None).not_here <= _SAID[1]:
            # The edges of the cells that were counted.
            east, north = ground.east_m[inside], ground.north_m[cells.any(axis=1)]
            areas.append(
                (
                    float(east[0]) - 0.5 * _CELL_M,
                    float(east[-1]) + 0.5 * _CELL_M,
                    float(north[0]) - 0.5 * _CELL_M,
                    float(north[-1]) + 0.5 * _CELL_M,
                )
            )
            if len(areas) == _AREAS:
                break
    return areas
