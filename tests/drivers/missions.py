"""Random searches in virtual time: areas, animals, wind, batteries, both autopilots."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from flown import HOME
from searched import Animal, Searched

from uavrt.core.messages import KeepOut
from uavrt.guidance.operator_orders import Limits
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES

FENCE_M = 400.0
LOWEST_M, HIGHEST_M = 25.0, 80.0
KEEP_M = 30.0
RESERVE_PERCENT = 25.0
WIND_M_S = 6.0
MODEL_W = 400.0
"""What is believed of a drone that nobody has told of; these take 0.7 to 3 times it."""
LONGEST_S = 420.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """What came of one."""

    seed: int
    flavour: Flavour
    wind_m_s: float
    hover_w: float
    farthest_m: float
    """From home."""
    lowest_m: float
    """Height above home while it was ours."""
    highest_m: float
    nearest_m: float
    """To any animal over ground, while it was ours."""
    home_percent: float | None
    """Of the battery, on the ground at home; None: it never came."""
    why: str
    found: int
    sought: int
    void_m: float
    """Least distance from people and buildings, while it was ours and on its way home."""


def flown(seed: int) -> Mission:
    """Fly one."""
    rng = np.random.default_rng(seed)
    flavour: Flavour = "px4" if rng.random() < 0.5 else "ardupilot"
    radius = float(rng.uniform(100.0, 280.0))
    animals = [_animal(rng, radius) for _ in range(int(rng.integers(1, 4)))]
    wind, towards = float(rng.uniform(0.0, WIND_M_S)), float(rng.uniform(0.0, 2.0 * math.pi))
    hunger, tells = hunger_of(seed)
    battery = float(rng.uniform(50.0, 90.0)) * hunger
    search = Searched(
        flavour,
        animals,
        seed=seed,
        limits=Limits(
            battery_wh=battery,
            speed_m_s=8.0,
            return_height_m=Frame().return_height_m,
            fence_m=FENCE_M,
            lowest_m=LOWEST_M,
            highest_m=HIGHEST_M,
            keep_away_m=KEEP_M,
            reserve_percent=RESERVE_PERCENT,
            keep_out=tuple(_keep_out(np.random.default_rng((seed, 1)), radius)),
        ),
        frame=Frame(
            hover_w=MODEL_W * hunger,
            battery_wh=battery,
            wind_m_s=(wind * math.cos(towards), wind * math.sin(towards)),
            gust_m=float(rng.uniform(0.1, 0.5)),
        ),
        radius_m=radius,
        duration_s=LONGEST_S,
    )
    search.flown.vehicle.heading.yaw_deg = float(rng.uniform(0.0, 360.0))
    search.flown.wind_m_s, search.flown.wind_told = None, tells
    search.flown.run(0.5)
    return _watched(search, seed, wind)


def hunger_of(seed: int) -> tuple[float, bool]:
    """Power over what the model believes, and whether the autopilot tells the wind."""
    rng = np.random.default_rng((seed, 2))
    return math.exp(float(rng.uniform(math.log(0.7), math.log(3.0)))), bool(rng.random() < 0.5)


def _keep_out(rng: np.random.Generator, radius: float) -> Iterator[KeepOut]:
    """Up to three people and buildings, none of them beside home."""
    for _ in range(int(rng.integers(0, 4))):
        size, turn = float(rng.uniform(8.0, 25.0)), float(rng.uniform(0.0, 2.0 * math.pi))
        off = float(rng.uniform(size + 30.0, max(radius, size + 40.0)))
        north, east = off * math.cos(turn), off * math.sin(turn)
        if rng.random() < 0.5:
            yield KeepOut(places=(HOME.to_geodetic(north, east),), radius_m=size)
            continue
        around = rng.uniform(0.0, math.pi) + np.array([0.0, 0.6, 1.6, 2.4]) * math.pi / 1.5
        yield KeepOut(
            places=tuple(
                HOME.to_geodetic(north + size * math.cos(a), east + size * math.sin(a))
                for a in around
            )
        )


def _animal(rng: np.random.Generator, radius: float) -> Animal:
    """Somewhere in the area, not at once beneath the drone."""
    off = math.sqrt(rng.uniform(60.0**2, radius**2)) if radius > 60.0 else 60.0
    angle, course = rng.uniform(0.0, 2.0 * math.pi, 2)
    speed = float(rng.uniform(0.0, 0.6)) if rng.random() < 0.3 else 0.0
    return Animal(
        off * math.cos(angle),
        off * math.sin(angle),
        level_db=float(rng.uniform(28.0, 45.0)),
        walks=(speed * math.cos(course), speed * math.sin(course)),
        interval_s=float(rng.uniform(1.0, 1.8)),
    )


def _watched(search: Searched, seed: int, wind: float) -> Mission:
    """Watch it while it is ours, then until it has landed."""
    vehicle = search.flown.vehicle
    voids = search.seeker_of(search.order()).area.excluded
    search.begin()
    search.nearest_m = math.inf
    farthest, heights, way = 0.0, [vehicle.body.shown_height_m], [vehicle.body.place_m]
    while not search.out:
        search.step()
        way.append(vehicle.body.place_m)
        farthest = max(farthest, math.hypot(*vehicle.body.place_m))
        heights.append(vehicle.body.shown_height_m)
    nearest, why = search.nearest_m, search.flown.authority.reason
    returning = vehicle.mode == MODES[search.flavour]["return"]
    for _ in range(20 * 300):
        if not vehicle.armed or not returning:
            break
        search.flown.step()
        way.append(vehicle.body.place_m)
    north, east = np.array(way).T
    return Mission(
        seed=seed,
        flavour=search.flavour,
        wind_m_s=wind,
        hover_w=search.frame.hover_w,
        farthest_m=farthest,
        lowest_m=min(heights),
        highest_m=max(heights),
        nearest_m=nearest,
        home_percent=None if vehicle.armed else vehicle.body.battery_percent,
        why=why,
        found=len(search.errors_m),
        sought=len(search.animals),
        void_m=min((float(one.off_m(east, north).min()) for one in voids), default=math.inf),
    )
