"""The world of a search: places of the tags, and the drone's received pulses.

It uses no code of the filters: levels are computed separately from each path. Random draws
depend only on the run's seed and the second, so all planners see the same animals and the same
fading.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import PATTERNS, monopole_gain_db
from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt_experiments.search.reflection import ReflectedRays
from uavrt_experiments.search.scenario import Scenario

_FREQUENCY_GHZ = 0.15
_CLUTTER_DB = (-100.0, 20.0)
"""Range of the levels of false pulses."""

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Level of one tag received in one second."""

    tag_id: int
    level_db: float | None
    """Received level; None: nothing was received."""


class World:
    """Tags that walk and beep once a second.

    `seed`: seed of the run.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self._scenario = scenario
        self._seed = seed
        truth = scenario.truth
        rng = np.random.default_rng((seed, 0))
        size = np.array([scenario.east_m, scenario.north_m])
        count = scenario.tags
        drawn = rng.random((count + truth.strangers, 2)) * size
        self.places_m: _Floats = drawn[:count].copy()
        if scenario.places:
            self.places_m = np.array(scenario.places[:count], np.float64)
        self._strangers_m = drawn[count:]
        self.levels_1m_db = truth.level_1m_db + truth.level_spread_db * rng.uniform(
            -1.0, 1.0, count
        )
        low, high = truth.exponent_range or (truth.exponent, truth.exponent)
        self.exponent = float(rng.uniform(low, high))
        if truth.exponent_range is not None:
            # The strength is given at 100 m: an exponent of another size turns about there.
            self.levels_1m_db = self.levels_1m_db + 20.0 * (self.exponent - truth.exponent)
        towards = rng.uniform(0.0, 2.0 * np.pi, count)
        self._velocity = np.zeros((count, 2))
        moving = truth.travellers
        self._velocity[:moving, 0] = truth.walk_speed_m_s * np.sin(towards[:moving])
        self._velocity[:moving, 1] = truth.walk_speed_m_s * np.cos(towards[:moving])
        self._rays = (
            None if truth.reflection is None else ReflectedRays(truth.reflection, count, seed)
        )
        self._pattern = PATTERNS[truth.antenna]

    @property
    def tag_ids(self) -> list[int]:
        """Numbers of present and absent tags."""
        return list(range(1, self._scenario.tags + self._scenario.absent + 1))

    def exists(self, tag_id: int) -> bool:
        """True if a tag is present."""
        return tag_id <= self._scenario.tags

    def step(self, second: int, state: VehicleState) -> list[Heard]:
        """Advance the world by a second; returns the drone's received pulses."""
        self.advance(second)
        return self.heard(second, state)

    def advance(self, second: int) -> None:
        """Advance the world by a second."""
        scenario, truth = self._scenario, self._scenario.truth
        steps = np.random.default_rng((self._seed, 1, second)).normal(size=(scenario.tags, 2))
        walkers = np.arange(scenario.tags) >= truth.travellers
        self.places_m += truth.walk_m_per_root_s * steps * walkers[:, None]
        self.places_m += self._velocity
        self._turn_back()

    def heard(self, second: int, state: VehicleState, drone: int = 0) -> list[Heard]:
        """Received pulses of a drone; each has its own fading, misses and false pulses."""
        scenario, truth = self._scenario, self._scenario.truth
        own = (drone,) if drone else ()
        rng = np.random.default_rng((self._seed, 1, second, *own))
        count = scenario.tags
        rng.normal(size=(count, 2))  # the animals' steps
        fading = truth.sigma_db * rng.normal(size=count)
        missed = rng.random(count)
        everyone = count + scenario.absent
        false, clutter = rng.random(everyone), rng.uniform(*_CLUTTER_DB, everyone)
        strange = truth.sigma_db * rng.normal(size=truth.strangers)
        out = []
        for number in range(everyone):
            level = None
            if number < count and missed[number] >= truth.missed_share:
                level = self.level_db(
                    state, self.places_m[number], float(self.levels_1m_db[number]), number
                ) + float(fading[number])
                level = level if level >= truth.threshold_db else None
            if number < truth.strangers and level is None:
                foreign = self.level_db(
                    state, self._strangers_m[number], truth.level_1m_db - 10.0
                ) + float(strange[number])
                level = foreign if foreign >= truth.threshold_db + 6.0 else None
            if level is None and false[number] < truth.chance_share:
                level = float(clutter[number])
                level = max(level, truth.threshold_db)
            out.append(Heard(tag_id=number + 1, level_db=level))
        return out

    def _turn_back(self) -> None:
        """Keep travellers in the area."""
        size = np.array([self._scenario.east_m, self._scenario.north_m])
        beyond = ((self.places_m < 0.0) & (self._velocity < 0.0)) | (
            (self.places_m > size) & (self._velocity > 0.0)
        )
        self._velocity = np.where(beyond, -self._velocity, self._velocity)

    def level_db(
        self, state: VehicleState, place_m: _Floats, level_1m_db: float, tag: int = 0
    ) -> float:
        """Mean level at the drone of a tag at a place; `tag` is its index."""
        truth = self._scenario.truth
        dx, dy = float(place_m[0]) - state.east_m, float(place_m[1]) - state.north_m
        tag_top = float(self._ground(place_m[0], place_m[1])) + truth.tag_height_m
        drone = state.height_m + float(self._ground(*self._scenario.start_m))
        height = max(1.0, drone - tag_top)
        flat = math.hypot(dx, dy)
        slant = math.hypot(flat, height)
        level = level_1m_db - 10.0 * self.exponent * math.log10(slant)
        if truth.antenna == "monopole":
            level += float(monopole_gain_db(math.degrees(math.atan2(height, flat))))
        else:
            turn = math.atan2(dx, dy) - math.radians(state.yaw_deg)
            unit = [flat * math.cos(turn), flat * math.sin(turn), height]
            level += float(
                self._pattern.gain_towards_db(*(np.array([one / slant]) for one in unit))[0]
            )
        if self._rays is not None:
            to_drone = np.array([-dx, -dy, drone - tag_top])
            level += self._rays.gain_db(tag, place_m, to_drone, truth.tag_height_m)
        if truth.vegetation_m > 0.0:
            level -= _vegetation_db(flat, height, truth.vegetation_m)
        if truth.ground is not None:
            level -= self._edge_db(state, place_m, drone, tag_top)
        return level

    def _ground(self, east_m: _Floats | float, north_m: _Floats | float) -> _Floats:
        ground = self._scenario.truth.ground
        east, north = np.asarray(east_m, np.float64), np.asarray(north_m, np.float64)
        return np.zeros(east.shape) if ground is None else ground(east, north)

    def _edge_db(
        self, state: VehicleState, place_m: _Floats, drone_m: float, tag_m: float
    ) -> float:
        """Loss over the highest edge between drone and tag [dB] (ITU-R P.526, simplified)."""
        share = np.linspace(0.04, 0.96, 24)
        dx, dy = place_m[0] - state.east_m, place_m[1] - state.north_m
        flat_km = max(math.hypot(dx, dy) / 1e3, 1e-6)
        ground = self._ground(state.east_m + share * dx, state.north_m + share * dy)
        clear = drone_m + share * (tag_m - drone_m) - ground
        # Of the first Fresnel zone: 17.3 √(d₁ d₂ / (f d)), GHz and km.
        zone = 17.3 * np.sqrt(share * (1.0 - share) * flat_km / _FREQUENCY_GHZ)
        loss = float(np.max(10.0 - 20.0 * clear / np.maximum(zone, 0.1)))
        return min(loss, 60.0) if loss > 6.0 else 0.0


def _vegetation_db(flat_m: float, height_m: float, grown_m: float) -> float:
    """Loss [dB] in plants: 0.25 f^.39 depth^.25 elevation^.05 (ITU-R P.833)."""
    elevation = math.atan2(height_m, max(flat_m, 1e-6))
    depth = min(grown_m / max(math.sin(elevation), 1e-3), 400.0)
    return float(0.25 * 150.0**0.39 * depth**0.25 * math.degrees(elevation) ** 0.05)
