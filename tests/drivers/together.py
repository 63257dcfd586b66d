"""Drones that search together in virtual time, by a ground station over a bad radio."""

import copy
import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from flown import STEP_S
from searched import Animal, Searched

from uavrt.core.messages import Course, Neighbour
from uavrt.ground.link.motions.path_assignments import PathAssignments
from uavrt.guidance.operator_orders import Limits, Order, VehicleNow
from uavrt.guidance.search.search_run import Choice
from uavrt.guidance.search.shared_search import SharedSearch
from uavrt.link.tunnel.own_messages.neighbour_messages import (
    decode_course,
    decode_neighbour,
    encode_course,
    encode_neighbour,
)
from uavrt.simulation.vehicle.airframe import Flavour, Frame

HOME_M = 30.0
"""Nearer to the home of all they come down."""


@dataclass
class Among(Searched):
    """One of them: it flies a way when it was given."""

    start_m: tuple[float, float] = (0.0, 0.0)
    """North, east."""
    height_m: float = 40.0
    number: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        vehicle = self.flown.vehicle
        vehicle.body.north_m, vehicle.body.east_m = self.start_m
        vehicle.body.height_m = self.height_m
        self.flown.run(1.2)
        self.shared = SharedSearch(1000 * self.number)
        self.not_given = 0
        self.goes_home = False
        self._course_s = 0.0

    def order(self, **values: object) -> Order:
        return super().order(height_m=self.height_m, **values)

    def started(self) -> None:
        now = self.flown.now()
        assert now is not None
        self.shared.begin(now.time_s)
        self.shared.check(now, self.height_m)
        self.begin()
        self.shared.go((now.latitude_deg, now.longitude_deg))

    @property
    def homeward(self) -> bool:
        """On its way home, by our commands or the autopilot's."""
        if not hasattr(self, "execution") or not self.flown.vehicle.armed:
            return False
        return not self.searching or self.goes_home or self.execution.returning

    def take_up(self, choice: Choice, now: VehicleNow) -> None:
        self.goes_home |= choice.returning
        super().take_up(choice, now)

    @property
    def searching(self) -> bool:
        return hasattr(self, "execution") and not self.out

    def decide(self, now: VehicleNow) -> None:
        if self.out:
            self.shared.end()
            return
        self.execution.shared = self.shared.has_others(now.time_s)
        if self.execution.returning:
            self.shared.go(now.home, returning=True)
        if self.shared.waits:
            answer = self.shared.answer(now)
            if answer is None:
                return
            choice, given = answer
            if given:
                decided = tuple(note for note in choice.notes if note.event == "decision")
                self.take_up(replace(choice, notes=decided), now)
            else:
                self.not_given += 1
                self.search_run.withdraw()
        elif self.is_time:
            others = self.shared.begin_decision(now.time_s)
            idle = self.execution.idle
            choice = self.search_run.decide(self.time_ns, now, idle=idle, others=others)
            flown_now = choice.steps is None or self.shared.choose(choice, now)
            if flown_now:
                self.take_up(choice, now)
            else:
                self._note(tuple(note for note in choice.notes if note.event != "decision"))

    def course(self) -> Course | None:
        """What is due to be told."""
        now = self.flown.now()
        if now is None or not self.shared.must_report(now.time_s):
            return None
        if now.time_s < self._course_s + (0.4 if self.shared.waits else 1.0):
            return None
        self._course_s = now.time_s
        return self.shared.course(now, searching=self.searching, height_m=self.height_m)


@dataclass
class Together:
    """All of them, and the station; each message may be late or lost."""

    flavour: Flavour
    animals: list[Animal]
    starts_m: list[tuple[float, float]]
    seed: int = 1
    loss: float = 0.0
    late_s: float = 0.2
    frame: Frame = field(default_factory=lambda: Frame(battery_wh=160.0, return_height_m=60.0))
    keep_away_m: float = 0.0

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng((self.seed, 77))
        limits = Limits(
            battery_wh=160.0, speed_m_s=8.0, fence_m=700.0, keep_away_m=self.keep_away_m
        )
        self.drones = [
            Among(
                self.flavour,
                copy.deepcopy(self.animals),
                seed=10 * self.seed + number,
                limits=limits,
                frame=self.frame,
                start_m=start,
                height_m=40.0 + 12.0 * number,
                number=number + 1,
            )
            for number, start in enumerate(self.starts_m)
        ]
        self.ways = PathAssignments()
        self.station_up = True
        self.silent: set[int] = set()
        """Drones whose radio is dead."""
        self.apart_m = math.inf
        """Least, of those that search."""
        self.heights_apart_m = math.inf
        """Least, where they are nearer than that over ground and one flies home."""
        self._post: list[tuple[float, int, Callable[[], None]]] = []
        self._sent = 0
        self._tell_s = 0.0
        self.time_s = 0.0

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()
            if until is not None and until():
                return

    def begin(self) -> None:
        self.run(3.0)
        for one in self.drones:
            one.started()

    @property
    def over(self) -> bool:
        return all(one.out for one in self.drones)

    def step(self) -> None:
        self.time_s += STEP_S
        for one in self.drones:
            if one.searching:
                one.step()
            else:
                one.flown.step()
                if hasattr(one, "execution"):
                    one.shared.end()
            course = one.course()
            if course is not None:
                self._up(one, encode_course(course))
        while self._post and self._post[0][0] <= self.time_s:
            heapq.heappop(self._post)[2]()
        if self.time_s >= self._tell_s:
            self._tell()
        self._measure()

    def _send(self, number: int, what: Callable[[], None]) -> None:
        if number in self.silent or not self.station_up or self.rng.random() < self.loss:
            return
        self._sent += 1
        late = float(self.rng.exponential(self.late_s)) if self.late_s else 0.0
        heapq.heappush(self._post, (self.time_s + late, self._sent, what))

    def _up(self, one: Among, payload: bytes) -> None:
        def take() -> None:
            if self.ways.receive_course(one.number, decode_course(payload), self.time_s):
                self._tell()

        self._send(one.number, take)

    def _tell(self) -> None:
        self._tell_s = self.time_s + 1.0
        for one in self.drones:
            for told in self.ways.reports_for(one.number, self.time_s):
                self._down(one, told)

    def _down(self, one: Among, told: Neighbour) -> None:
        payload = encode_neighbour(told)
        self._send(
            one.number, lambda: one.shared.receive(decode_neighbour(payload), one.flown.time_s)
        )

    def _measure(self) -> None:
        """How near they are; at home, where all of them land, nothing is asked."""
        for number, a in enumerate(self.drones):
            for b in self.drones[:number]:
                one, two = a.flown.vehicle, b.flown.vehicle
                apart = math.dist(one.body.place_m, two.body.place_m)
                if a.searching and b.searching and not (a.homeward or b.homeward):
                    self.apart_m = min(self.apart_m, apart)
                at_home = any(
                    math.hypot(*vehicle.body.place_m) < HOME_M for vehicle in (one, two)
                )
                if (a.homeward or b.homeward) and not at_home and apart < 25.0:
                    off = abs(one.body.height_m - two.body.height_m)
                    self.heights_apart_m = min(self.heights_apart_m, off)
