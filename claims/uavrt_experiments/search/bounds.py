"""Bounds that no search can beat, for its errors and its time.

*Error*: the posterior Cramér–Rao bound along the path flown, with known strength of each tag
and known law of its levels:

J(k+1) = (Q + J(k)⁻¹)⁻¹ + gradient gradientᵀ / σ²

Here the gradient is that of the true level over the tag's place: 10 n / (ln 10 · r) along the
distance, and the antenna's slope. J begins with the variance of the area, and ends when the tag
is reported as found. The inverse of the *mean* information of all tags bounds the mean square
of errors (van Trees). The mean of inverses does not; some errors are below it.

*Time*: a tag is found once its stop rule holds, and each rule needs an amount of information
(the trace of J). Two ideal drones bound the time to get it:

- one flies straight to the tag, and gets from each pulse the most information possible there,
whatever its heading;
- one flies no farther than needed past all tags: in T seconds it must come so near to each that
T pulses from there suffice. No such path is shorter than the shortest tree between the start
and circles of that size.

Turning, doubts of existence and unknown strengths take more time. The bounds hold on average:
in single runs, a cloud is sometimes smaller than its information allows.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt.planning.stopping import AccuracyStop, StopRule
from uavrt_experiments.search.scenario import Scenario
from uavrt_experiments.search.stops import DeterminantStop, LongestAxisStop
from uavrt_experiments.search.world import World

_Floats = NDArray[np.float64]
_STEP_M = 0.5
"""Half of the step of a numerical gradient [m]."""
_CHI2_95 = -2.0 * math.log(0.05)
_DISTANCES = 60
_HEADINGS = 61


def heard_share(below_sigmas: float) -> float:
    """Share of a level's information that remains if low levels are missed.

    A received level gives its value, a missed pulse only that the level was below the threshold
    (Tobit's model).

    `below_sigmas`: threshold minus mean level, in standard deviations of the fading.
    """
    u = below_sigmas
    if abs(u) > 8.0:
        return float(u < 0.0)
    density = math.exp(-0.5 * u * u) / math.sqrt(2.0 * math.pi)
    silent = 0.5 * math.erfc(-u / math.sqrt(2.0))
    return 1.0 - silent + u * density + density**2 / silent


def pulse_information(
    level_db: Callable[[_Floats], float],
    place_m: _Floats,
    *,
    sigma_db: float,
    threshold_db: float = -math.inf,
    missed_share: float = 0.0,
) -> _Floats:
    """Fisher information [1/m²] of one pulse on the place of its tag, shape (2, 2).

    `level_db`: mean level received from a tag at a place, shape (2,): east and north [dB].
    `sigma_db`: standard deviation of the fading [dB].
    `threshold_db`: level below which pulses are missed [dB].
    `missed_share`: share of pulses that are missed whatever their level.
    """
    steps = _STEP_M * np.eye(2)
    slope = np.array(
        [(level_db(place_m + one) - level_db(place_m - one)) / (2 * _STEP_M) for one in steps]
    )
    heard = 1.0
    if math.isfinite(threshold_db):
        heard = heard_share((threshold_db - level_db(place_m)) / sigma_db)
    return np.asarray((1.0 - missed_share) * heard * np.outer(slope, slope) / sigma_db**2)


def after_a_second(information: _Floats, walk_m_per_root_s: float) -> _Floats:
    """Remaining information [1/m²], shape (2, 2), after a tag has walked for a second."""
    if walk_m_per_root_s == 0.0:
        return information
    walked = walk_m_per_root_s**2 * np.eye(2)
    return np.asarray(np.linalg.inv(walked + np.linalg.inv(information)))


def least_rms_m(information: _Floats) -> float:
    """Least root mean square of errors [m].

    `information` (tags, 2, 2): information on each tag's place [1/m²].
    """
    return float(np.sqrt(np.trace(np.linalg.inv(information.mean(axis=0)))))


def least_mean_m(information: _Floats) -> float:
    """Mean length [m] of normal errors with the smallest possible covariance, as in
    `least_rms_m`.
    """
    from scipy.special import ellipe

    least, most = np.linalg.eigvalsh(information.mean(axis=0))
    return math.sqrt(2.0 / (math.pi * least)) * float(ellipe(1.0 - least / most))


class LeastErrors:
    """The posterior Cramér–Rao bound of each tag along a flight.

    Over hills there is none, because exactly known edges of hills could locate a tag by
    themselves.

    `world`: the world in each second of the flight.
    """

    def __init__(self, scenario: Scenario, world: World) -> None:
        self._truth, self._world = scenario.truth, world
        tags = () if scenario.truth.ground else range(1, scenario.tags + 1)
        self._known = dict.fromkeys(tags, _of_area(scenario))

    def hear(self, states: Sequence[VehicleState]) -> None:
        """Add the information that pulses of one second give.

        `states`: state of each drone.
        """
        truth = self._truth
        for tag_id, known in self._known.items():
            walks = tag_id > truth.travellers
            left = after_a_second(known, truth.walk_m_per_root_s if walks else 0.0)
            self._known[tag_id] = left + sum(self._pulse(tag_id, state) for state in states)

    def of(self, tag_id: int) -> tuple[float, float, float] | None:
        """Information on a tag's place attainable so far [1/m²]; ends the tag's bound.

        The elements are east-east, east-north and north-north.
        """
        known = self._known.pop(tag_id, None)
        if known is None:
            return None
        return float(known[0, 0]), float(known[0, 1]), float(known[1, 1])

    def _pulse(self, tag_id: int, state: VehicleState) -> _Floats:
        world = self._world
        level_1m_db = float(world.levels_1m_db[tag_id - 1])
        return pulse_information(
            lambda place: world.level_db(state, place, level_1m_db, tag_id - 1),
            world.places_m[tag_id - 1],
            sigma_db=self._truth.sigma_db,
            threshold_db=self._truth.threshold_db,
            missed_share=self._truth.missed_share,
        )


def _of_area(scenario: Scenario) -> _Floats:
    """Information of the area alone: the inverse of its variance."""
    return np.diag([12.0 / scenario.east_m**2, 12.0 / scenario.north_m**2])


# ------------------------------------------------------------------------- the time


def needed_information(stop: StopRule) -> float | None:
    """Trace of the least information [1/m²] with which a stop rule holds; None: unknown.

    Of all clouds that satisfy a rule, the round one needs least.
    """
    match stop:
        case DeterminantStop():
            return 2.0 / math.sqrt(stop.limit_m4)
        case LongestAxisStop():
            return 2.0 / stop.limit_m**2
        case AccuracyStop():
            return 2.0 * _CHI2_95 / stop.radius95_m**2
    return None


def tree_m(start_m: _Floats, circles_m: _Floats, radii_m: _Floats) -> float:
    """Length [m] of the shortest tree from a start to circles; no path past all is shorter.

    `start_m` (starts, 2): starts of the drones; several count as one that is at all of them.
    `circles_m` (circles, 2): centres.
    `radii_m`: radii, shape (circles,).
    """
    between = np.linalg.norm(circles_m[:, None] - circles_m[None], axis=2)
    between = np.maximum(between - radii_m[:, None] - radii_m[None], 0.0)
    away = np.linalg.norm(circles_m[:, None] - start_m[None], axis=2).min(axis=1)
    away = np.maximum(away - radii_m, 0.0)
    length, left = 0.0, set(range(len(circles_m)))
    while left:
        nearest = min(left, key=lambda one: away[one])
        length += float(away[nearest])
        left.remove(nearest)
        away = np.minimum(away, between[nearest])
    return length


def least_time_s(
    scenario: Scenario, stop: StopRule, seed: int, starts: Sequence[VehicleState]
) -> float | None:
    """Time [s] before which no search of a drawn world ends; None: unknown.

    `seed`: seed of the run.
    `starts`: start of each drone.
    """
    needed = needed_information(stop)
    if needed is None or scenario.truth.ground is not None:
        return None
    needed -= float(np.trace(_of_area(scenario)))
    world = World(scenario, seed)
    most = most_informative(scenario, world.exponent, float(world.levels_1m_db.max()))
    start = np.array([(one.east_m, one.north_m) for one in starts])
    speed = scenario.vehicle.speed_m_s
    first = world.places_m.copy()
    gathered, moved = np.zeros(len(first)), np.zeros(len(first))
    for second in range(1, scenario.limit_s + 1):
        world.advance(second)
        moved = np.maximum(moved, np.linalg.norm(world.places_m - first, axis=1))
        away = np.linalg.norm(world.places_m[:, None] - start[None], axis=2).min(axis=1)
        gathered += len(starts) * most.at(np.maximum(away - speed * second, 0.0))
        if gathered.min() < needed:
            continue
        near = most.within(needed / (second * len(starts)))
        if tree_m(start, first, near + moved) <= speed * second * len(starts):
            return float(second)
    return float(scenario.limit_s)


class MostInformative:
    """Greatest information of a pulse at a distance or beyond it, whatever the heading.

    `distances_m` (n,): distances over ground, rising from 0 [m].
    `information`: greatest trace at each [1/m²].
    """

    def __init__(self, distances_m: _Floats, information: _Floats) -> None:
        self._distances = distances_m
        self._most = np.maximum.accumulate(information[::-1])[::-1]

    def at(self, distances_m: _Floats) -> _Floats:
        """Greatest information at given distances [1/m²], rounded up."""
        place = np.searchsorted(self._distances, distances_m, side="right") - 1
        return np.asarray(self._most[place])

    def within(self, information: float) -> float:
        """Farthest distance [m] at which a pulse may give this information, rounded up."""
        enough = np.flatnonzero(self._most >= information)
        if not len(enough):
            return 0.0
        return float(self._distances[min(enough[-1] + 1, len(self._distances) - 1)])


def most_informative(
    scenario: Scenario, exponent: float, level_1m_db: float
) -> MostInformative:
    """Evaluate all distances in a scenario, with all headings of the antenna.

    `exponent`: path loss exponent drawn for a run.
    `level_1m_db`: level of the strongest tag at 1 m [dB]; a weaker one adds nothing.
    """
    truth = scenario.truth
    distances, level, along, across = _levels_around(scenario)
    slant = np.hypot(distances, scenario.height_m - truth.tag_height_m)[:, None]
    steeper = exponent - truth.exponent
    level = level + level_1m_db - 10.0 * steeper * np.log10(slant)
    along = along - 10.0 * steeper / math.log(10.0) * distances[:, None] / slant**2
    below = (truth.threshold_db - level) / truth.sigma_db
    heard = np.vectorize(heard_share)(below) * (1.0 - truth.missed_share)
    trace = heard * (along**2 + across**2) / truth.sigma_db**2
    return MostInformative(distances, trace.max(axis=1))


@lru_cache(maxsize=32)
def _levels_around(scenario: Scenario) -> tuple[_Floats, _Floats, _Floats, _Floats]:
    """Distances, and for each (and each heading) the level of a tag of 0 dB and its slopes
    [dB/m].

    Slopes are along the distance and across it, for the scenario's exponent.
    """
    world = World(scenario, 0)
    world.exponent = scenario.truth.exponent
    farthest = 2.0 * math.hypot(scenario.east_m, scenario.north_m)
    distances = farthest * np.linspace(0.0, 1.0, _DISTANCES) ** 2

    def level(east_m: float, north_m: float, yaw_deg: float) -> float:
        state = VehicleState(
            time_s=0.0, east_m=0.0, north_m=0.0, height_m=scenario.height_m, yaw_deg=yaw_deg
        )
        return world.level_db(state, np.array([east_m, north_m]), 0.0)

    h = _STEP_M
    looked = np.array(
        [
            [
                [level(x, d + y, yaw) for x, y in ((0, 0), (0, h), (0, -h), (h, 0), (-h, 0))]
                for yaw in np.linspace(0.0, 180.0, _HEADINGS)
            ]
            for d in distances
        ]
    )
    along = (looked[..., 1] - looked[..., 2]) / (2.0 * h)
    across = (looked[..., 3] - looked[..., 4]) / (2.0 * h)
    return distances, looked[..., 0], along, across
