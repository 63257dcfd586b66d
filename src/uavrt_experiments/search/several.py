"""One run of several drones that search together."""

import time
from dataclasses import replace

import numpy as np

from uavrt.localization import Listening
from uavrt.planning import (
    Polygon,
    Rotate,
    SearchArea,
    SearchSettings,
    SearchTogether,
    Separation,
    VehicleState,
)
from uavrt_experiments.search.bounds import LeastErrors
from uavrt_experiments.search.flight import (
    Judged,
    Outcome,
    beliefs_of,
    judged,
    planner_of,
    start_of,
)
from uavrt_experiments.search.scenario import Contender, Scenario
from uavrt_experiments.search.world import World

SEPARATION = Separation()
_START_GAP_M = 30.0
"""Between drones that start at one corner."""
_BETWEEN = np.linspace(0.0, 1.0, 11)


def starts_of(scenario: Scenario, contender: Contender) -> dict[int, VehicleState]:
    """Where the drones begin, by number; each 10 m above the one before."""
    east, north = scenario.east_m, scenario.north_m
    start = start_of(scenario)
    x, y = scenario.start_m
    corners = ((0.0, 0.0), (east, north), (east, 0.0), (0.0, north))
    return {
        number: replace(
            start,
            east_m=corners[number][0] if contender.corners else x + _START_GAP_M * number,
            north_m=corners[number][1] if contender.corners else y,
            height_m=start.height_m + SEPARATION.height_m * number,
        )
        for number in range(contender.drones)
    }


class FlightOfSeveral:
    """Drones that search a world until every tag is found or the time is over.

    Parameters
    ----------
    scenario : Scenario
    contender : Contender
        Says how many drones start where.
    seed : int
    particles : int
    vanishes : (int, float), optional
        A drone, and when it stands still and is not heard of any more.
    """

    def __init__(
        self,
        scenario: Scenario,
        contender: Contender,
        seed: int,
        particles: int,
        vanishes: tuple[int, float] | None = None,
    ) -> None:
        self.scenario, self.seed, self._vanishes = scenario, seed, vanishes
        self.world = World(scenario, seed)
        self.least = LeastErrors(scenario, self.world)
        polygon = Polygon.rectangle(0.0, scenario.east_m, 0.0, scenario.north_m)
        settings = SearchSettings(
            vehicle=scenario.vehicle,
            area=SearchArea(search=polygon, lowest_m=5.0, highest_m=500.0),
            stop=scenario.paper_stop if contender.stop == "paper" else scenario.our_stop,
            keep_away=scenario.keep_away,
            cycle_s=float(scenario.cycle_s),
            threshold_db=scenario.truth.threshold_db,
            tag_height_m=scenario.truth.tag_height_m,
        )
        self.states = starts_of(scenario, contender)
        self.search = SearchTogether(
            settings,
            beliefs_of(scenario, contender, seed, particles, self.world),
            self.states,
            lambda: planner_of(contender),
            {number: np.random.default_rng((seed, 4, number)) for number in self.states},
            separation=SEPARATION,
        )
        self.second = 0
        self._decides = dict.fromkeys(self.states, scenario.first_plan_s)
        self.paths = {n: [(one.east_m, one.north_m)] for n, one in self.states.items()}
        self.judged: list[Judged] = []
        self.decision_s: list[float] = []
        self.nearest_m = self.apart_m = float("inf")
        self.too_near_s = 0
        self._clear: set[int] = set()

    def flown(self) -> Outcome:
        """Fly it."""
        scenario = self.scenario
        while not self._done():
            for number in self.states:
                if self.second >= self._decides[number] and not self._gone(number):
                    self._decide(number)
            self.second += 1
            self._move()
            self._hear()
        there = [one for one in self.judged if self.world.exists(one.tag_id)]
        tracks = [np.array(path) for path in self.paths.values()]
        ways = [np.hypot(*np.diff(track, axis=0).T).sum() for track in tracks]
        return Outcome(
            seed=self.seed,
            time_s=float(self.second),
            distance_m=float(sum(ways)),
            judged=tuple(self.judged),
            lost=scenario.tags - len(there),
            nearest_m=self.nearest_m,
            too_near_s=self.too_near_s,
            decision_s=tuple(self.decision_s),
            path_m=tuple(
                point for path in self.paths.values() for point in (*path, (np.nan, np.nan))
            ),
            ends_m=tuple((float(x), float(y)) for x, y in self.world.places_m),
            apart_m=self.apart_m,
        )

    def _gone(self, number: int) -> bool:
        vanishes = self._vanishes
        return vanishes is not None and number == vanishes[0] and self.second >= vanishes[1]

    def _done(self) -> bool:
        found = sum(self.world.exists(one.tag_id) for one in self.judged)
        return found == self.scenario.tags or self.second >= self.scenario.limit_s

    def _decide(self, number: int) -> None:
        began = time.process_time()
        decision = self.search.decide(number, self.states[number])
        self.decision_s.append(time.process_time() - began)
        span = self.scenario.cycle_s
        if isinstance(decision.action, Rotate):
            # It is turned to its end.
            span = round(self.search.announced(number).time_s[-1] - self.second)
        self._decides[number] = self.second + max(1, span)

    def _move(self) -> None:
        before = self.states
        self.states = {n: self._state_of(n) for n in before}
        for number, state in self.states.items():
            self.paths[number].append((state.east_m, state.north_m))
        shares = {
            n: (
                before[n].east_m + _BETWEEN * (one.east_m - before[n].east_m),
                before[n].north_m + _BETWEEN * (one.north_m - before[n].north_m),
            )
            for n, one in self.states.items()
        }
        for a in shares:
            for b in range(a):
                off = np.hypot(shares[a][0] - shares[b][0], shares[a][1] - shares[b][1])
                self.apart_m = min(self.apart_m, float(off.min()))

    def _state_of(self, number: int) -> VehicleState:
        """On its announced way, and at its end afterwards."""
        if self._gone(number):
            return self.states[number]
        path = self.search.announced(number)
        place = int(np.searchsorted(path.time_s, self.second - 1e-6))
        state = path.state(min(place, len(path.time_s) - 1))
        return replace(state, time_s=float(self.second))

    def _hear(self) -> None:
        self.world.advance(self.second)
        heard = [state for number, state in self.states.items() if not self._gone(number)]
        self.least.hear(heard)
        rule = self.scenario.keep_away
        for number, state in self.states.items():
            if self._gone(number):
                continue
            self.search.report(number, state)
            places = self.world.places_m
            off = np.hypot(places[:, 0] - state.east_m, places[:, 1] - state.north_m)
            self.nearest_m = min(self.nearest_m, float(off.min()))
            near = rule is not None and float(off.min()) < rule.radius_m
            # A drone that starts beside an animal first leaves it.
            self._clear |= set() if near else {number}
            self.too_near_s += int(near and number in self._clear)
            for one in self.world.heard(self.second, state, number):
                if one.tag_id not in self.search.found or rule is not None:
                    self._take(one.tag_id, state, one.level_db)
        for tag_id in self.search.judge(float(self.second)):
            self._note(tag_id)

    def _take(self, tag_id: int, state: VehicleState, level_db: float | None) -> None:
        truth = self.scenario.truth
        self.search.listen(
            tag_id,
            float(self.second),
            Listening(
                east_m=state.east_m,
                north_m=state.north_m,
                height_m=state.height_m - truth.tag_height_m,
                snr_db=level_db,
                threshold_db=truth.threshold_db,
                yaw_deg=state.yaw_deg,
            ),
        )

    def _note(self, tag_id: int) -> None:
        self.judged.append(judged(self.search.found[tag_id], tag_id, self.world, self.least))
