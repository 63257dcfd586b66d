"""One run: a planner searches a world until every tag is found or the time is over."""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.trackers import TagPrior
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.planning.area import Polygon, SearchArea
from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.detectability.ground_propagation import GroundReflection
from uavrt.planning.drone_model.drone_motion import Path, Vehicle, VehicleState, Wind, flown
from uavrt.planning.drone_model.planner_actions import Action, FlyTo, Hold, Return
from uavrt.planning.search import Found, Search
from uavrt.planning.situation import Planner, SearchSettings
from uavrt_experiments.search.baselines.names import any_planner
from uavrt_experiments.search.baselines.published import Shannon
from uavrt_experiments.search.bounds import LeastErrors
from uavrt_experiments.search.level import at_100_m
from uavrt_experiments.search.reflection import FREQUENCY_HZ
from uavrt_experiments.search.scenario import Contender, Scenario, Truth
from uavrt_experiments.search.terrain import mapped
from uavrt_experiments.search.world import Heard, World

_Floats = NDArray[np.float64]
_INJECTION = 0.1
"""Share of particles that TrackerBots replaces, and share of steps in which it does so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A tag that a run reported as found."""

    tag_id: int
    time_s: float
    error_m: float | None
    """Distance of the tag from the reported place [m]; None: there is no such tag."""
    radius95_m: float
    information: tuple[float, float, float] | None = None
    """Information on the place attainable when the tag was found [1/m²]: east-east, east-north,
    north-north."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Result of one search."""

    seed: int
    time_s: float
    """Time until the last tag was found, or the limit [s]."""
    distance_m: float
    judged: tuple[Judged, ...]
    lost: int
    """Number of present tags that were not found."""
    nearest_m: float
    """Least distance of a drone from any animal, over ground [m]."""
    too_near_s: int
    """Time within the distance to keep from animals [s]."""
    decision_s: tuple[float, ...]
    """Processor time of each decision [s]."""
    path_m: tuple[tuple[float, float], ...]
    ends_m: tuple[tuple[float, float], ...]
    """Final places of the tags, east and north [m]."""
    apart_m: float = float("inf")
    """Least distance of two drones, over ground [m]."""
    least_time_s: float | None = None
    """Bound of the time of any search of this world [s]; None: unknown."""

    @property
    def complete(self) -> bool:
        """True if every present tag was found."""
        return self.lost == 0

    @property
    def mean_error_m(self) -> float:
        """Mean error of found tags that are present [m]; NaN without any."""
        errors = [one.error_m for one in self.judged if one.error_m is not None]
        return float(np.mean(errors)) if errors else float("nan")


def priors_of(scenario: Scenario, world: World) -> list[TagPrior]:
    """Prior of each tag; strengths known to the searcher are those of the world."""
    truth, known = scenario.truth, scenario.known
    prior = TagPrior(
        area=Area(west_m=0.0, east_m=scenario.east_m, south_m=0.0, north_m=scenario.north_m),
        level_db=at_100_m(truth.level_1m_db, truth.exponent),
        level_sigma_db=known.level_sigma_db,
        level_drift_db_per_root_s=known.level_drift_db_per_root_s,
        exponent=truth.exponent,
        exponent_sigma=known.exponent_sigma,
        fading_db=known.sigma_db or truth.sigma_db,
        shadowing_db=0.0,
        reflects=False,
        pattern=pattern_of(truth),
        walking_m_per_root_s=(
            truth.walk_m_per_root_s
            if known.walk_m_per_root_s is None
            else known.walk_m_per_root_s
        ),
        travelling_m_s=known.travelling_m_s,
        motion=known.motion,
        missed_share=_share(known.missed_share, truth.missed_share),
        chance_share=_share(known.chance_share, truth.chance_share),
        path_gain=GroundReflection(tag_height_m=truth.tag_height_m)
        if truth.reflection
        else None,
        hills=map_of(scenario),
    )
    count = scenario.tags + scenario.absent
    if not known.each:
        return [prior] * count
    return [
        replace(prior, level_db=at_100_m(float(level), world.exponent), exponent=world.exponent)
        for level in world.levels_1m_db
    ] + [prior] * scenario.absent


def beliefs_of(
    scenario: Scenario, contender: Contender, seed: int, particles: int, world: World
) -> Beliefs:
    """Beliefs before the flight."""
    priors = priors_of(scenario, world)
    if contender.filter == "TrackerBots":
        priors = [replace(one, missed_share=0.0, chance_share=1e-6) for one in priors]
    return Beliefs(
        *(
            TagBelief(
                number + 1, prior, np.random.default_rng((seed, 2, number)), particles=particles
            )
            for number, prior in enumerate(priors)
        )
    )


def map_of(scenario: Scenario) -> HillLosses | None:
    """The searcher's map of the ground."""
    truth = scenario.truth
    if truth.ground is None or not scenario.known.map_of_heights:
        return None
    return mapped(
        truth.ground,
        east_m=scenario.east_m,
        north_m=scenario.north_m,
        start_m=scenario.start_m,
        tag_m=truth.tag_height_m,
        frequency_hz=FREQUENCY_HZ,
    )


def pattern_of(truth: Truth) -> AntennaPattern | None:
    """Get the antenna's pattern; None: an upright monopole."""
    return None if truth.antenna == "monopole" else PATTERNS[truth.antenna]


def _share(believed: float | None, true: float) -> float:
    """Share of an event that the searcher assumes; at least 0.001, so that no event is
    impossible.
    """
    return max(true if believed is None else believed, 1e-3)


def fly(
    scenario: Scenario, contender: Contender, seed: int, *, particles: int = 10_000
) -> Outcome:
    """Fly one run; a planner marked `easier` flies the easier case."""
    return _Flight(flown_case(scenario, contender), contender, seed, particles).flown()


def start_of(scenario: Scenario) -> VehicleState:
    """Start of a drone that searches alone."""
    return VehicleState(
        time_s=0.0,
        east_m=scenario.start_m[0],
        north_m=scenario.start_m[1],
        height_m=scenario.height_m,
        yaw_deg=scenario.start_yaw_deg,
    )


def flown_case(scenario: Scenario, contender: Contender) -> Scenario:
    """Scenario that a planner flies; the easier case if it is marked so."""
    return (scenario.easier or scenario) if contender.easier else scenario


def planner_of(contender: Contender) -> Planner:
    """Make a planner by name, or with its settings for this comparison."""
    if contender.planner == "shannon" and contender.turn_s > 0.0:
        return Shannon(rotation_s=contender.turn_s)
    return any_planner(contender.planner)


class _Flight:
    def __init__(
        self, scenario: Scenario, contender: Contender, seed: int, particles: int
    ) -> None:
        self.scenario, self.contender, self.seed = scenario, contender, seed
        self.world = World(scenario, seed)
        self.rng = np.random.default_rng((seed, 3))
        stop = scenario.paper_stop if contender.stop == "paper" else scenario.our_stop
        polygon = Polygon.rectangle(0.0, scenario.east_m, 0.0, scenario.north_m)
        settings = SearchSettings(
            vehicle=scenario.vehicle,
            area=SearchArea(search=polygon, lowest_m=5.0, highest_m=500.0),
            stop=stop,
            keep_away=scenario.keep_away,
            cycle_s=float(scenario.cycle_s),
            threshold_db=scenario.truth.threshold_db,
            tag_height_m=scenario.truth.tag_height_m,
        )
        beliefs = beliefs_of(scenario, contender, seed, particles, self.world)
        self.search = Search(
            settings, beliefs, planner_of(contender), np.random.default_rng((seed, 4))
        )
        self.state = start_of(scenario)
        self.least = LeastErrors(scenario, self.world)
        self.second = 0
        self.distance_m = 0.0
        self.nearest_m = float("inf")
        self.too_near_s = 0
        self.judged: list[Judged] = []
        self.decision_s: list[float] = []
        self.path: list[tuple[float, float]] = [scenario.start_m]

    def flown(self) -> Outcome:
        scenario = self.scenario
        first = Hold(duration_s=float(scenario.first_plan_s))
        self._follow(flown(scenario.vehicle, self.state, first), scenario.first_plan_s)
        while not self._done():
            began = time.process_time()
            decision = self.search.decide(self.state)
            self.decision_s.append(time.process_time() - began)
            if isinstance(decision.action, Return):
                break
            action = self._in_cycle(decision.action)
            path = flown(scenario.vehicle, self.state, action)
            moves = isinstance(action, FlyTo)
            self._follow(path, scenario.cycle_s if moves else len(path.time_s))
        there = [one for one in self.judged if self.world.exists(one.tag_id)]
        return Outcome(
            seed=self.seed,
            time_s=float(self.second),
            distance_m=self.distance_m,
            judged=tuple(self.judged),
            lost=scenario.tags - len(there),
            nearest_m=self.nearest_m,
            too_near_s=self.too_near_s,
            decision_s=tuple(self.decision_s),
            path_m=tuple(self.path),
            ends_m=tuple((float(x), float(y)) for x, y in self.world.places_m),
        )

    def _done(self) -> bool:
        """True if every present tag is found, which stops the clock of a table."""
        found = sum(self.world.exists(one.tag_id) for one in self.judged)
        return found == self.scenario.tags or self.second >= self.scenario.limit_s

    def _in_cycle(self, action: Action) -> Action:
        if not self.scenario.stops_each_cycle or not isinstance(action, FlyTo):
            return action
        vehicle, cycle = self.scenario.vehicle, float(self.scenario.cycle_s)
        return reachable(vehicle, self.state, action, Wind(), cycle)

    def _follow(self, path: Path, seconds: int) -> None:
        steps = min(len(path.time_s), seconds)
        for number in range(steps):
            state = path.state(number)
            self.distance_m += float(
                np.hypot(state.east_m - self.state.east_m, state.north_m - self.state.north_m)
            )
            self.second += 1
            self.state = replace(state, time_s=float(self.second))
            self.path.append((state.east_m, state.north_m))
            self._hear(self.world.step(self.second, self.state))
            if self._done():
                return
        if self.scenario.stops_each_cycle:
            # The cycle is over when it is over, even where the way was shorter.
            for _ in range(seconds - steps):
                self.second += 1
                self.state = replace(self.state, time_s=float(self.second))
                self._hear(self.world.step(self.second, self.state))
                if self._done():
                    return

    def _hear(self, heard: list[Heard]) -> None:
        scenario, search = self.scenario, self.search
        self.least.hear([self.state])
        places = self.world.places_m
        off = np.hypot(places[:, 0] - self.state.east_m, places[:, 1] - self.state.north_m)
        self.nearest_m = min(self.nearest_m, float(off.min()))
        rule = scenario.keep_away
        self.too_near_s += int(rule is not None and float(off.min()) < rule.radius_m)
        for one in heard:
            if one.tag_id in search.found and rule is None:
                continue
            self._take(one)
        for tag_id in search.judge(float(self.second)):
            self._note(tag_id)

    def _take(self, one: Heard) -> None:
        scenario, search, time_s = self.scenario, self.search, float(self.second)
        height = self.state.height_m - scenario.truth.tag_height_m
        simple = self.contender.filter == "TrackerBots"
        if simple and one.level_db is None:
            return
        search.listen(
            one.tag_id,
            time_s,
            Listening(
                east_m=self.state.east_m,
                north_m=self.state.north_m,
                height_m=height,
                snr_db=one.level_db,
                threshold_db=scenario.truth.threshold_db,
                yaw_deg=self.state.yaw_deg,
            ),
        )
        if simple and self.rng.random() < _INJECTION:
            search.beliefs[one.tag_id].tracker.replace_at_random(_INJECTION)

    def _note(self, tag_id: int) -> None:
        self.judged.append(judged(self.search.found[tag_id], tag_id, self.world, self.least))


def judged(found: Found, tag_id: int, world: World, least: LeastErrors) -> Judged:
    """Compare found tags with the truth, and with the attainable information."""
    error = None
    if world.exists(tag_id):
        x, y = world.places_m[tag_id - 1]
        error = float(np.hypot(found.estimate.east_m - x, found.estimate.north_m - y))
    return Judged(
        tag_id=tag_id,
        time_s=found.time_s,
        error_m=error,
        radius95_m=found.estimate.radius95_m,
        information=least.of(tag_id),
    )


def reachable(
    vehicle: Vehicle, state: VehicleState, action: FlyTo, wind: Wind, within_s: float
) -> FlyTo:
    """Nearest place on the path where a drone that must brake can stop."""
    whole = float(
        vehicle.durations(state, np.array([action.east_m]), np.array([action.north_m]), wind)[0]
    )
    if whole <= within_s:
        return action
    shares = np.linspace(0.0, 1.0, 101)[1:]
    east = state.east_m + shares * (action.east_m - state.east_m)
    north = state.north_m + shares * (action.north_m - state.north_m)
    in_time = np.flatnonzero(vehicle.durations(state, east, north, wind) <= within_s + 1e-6)
    last = int(in_time[-1]) if len(in_time) else 0
    return replace(action, east_m=float(east[last]), north_m=float(north[last]))
