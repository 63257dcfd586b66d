"""Search flights by the guide's own parts on simulated drones.

The drone's own objects decide, with the arguments that the guide gives them. A table's scenario
adds prior knowledge of its animals. One drone flies alone; several get their paths assigned by
the ground station's `PathAssignments`.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.messages import (
    FlyThere,
    Manoeuvre,
    Pose,
    Pulse,
    PulsePose,
    SearchReport,
    Tag,
    TurnInPlace,
)
from uavrt.core.units import ns_from_s, wrap_degrees_360
from uavrt.drone.processes.guide import COURSE_S, PATH_REQUEST_S
from uavrt.drone.processes.search_thread import SearchThread
from uavrt.ground.link.motions.path_assignments import PathAssignments
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.vehicle_commands import VehicleCommand
from uavrt.guidance.operator_orders import Limits, Order, VehicleNow
from uavrt.guidance.order_execution import OrderExecution
from uavrt.guidance.search.neighbour_drones import SEPARATION
from uavrt.guidance.search.search_run import Choice, SearchRun
from uavrt.guidance.search.search_task import Equipment
from uavrt.guidance.search.shared_search import SharedSearch
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import command_message
from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt.simulation.scene.geometry import TangentPlane
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES, FlyingVehicle
from uavrt_experiments.search.bounds import LeastErrors
from uavrt_experiments.search.flight import (
    Judged,
    Outcome,
    map_of,
    pattern_of,
    priors_of,
    start_of,
)
from uavrt_experiments.search.reflection import FREQUENCY_HZ
from uavrt_experiments.search.scenario import Contender, Scenario
from uavrt_experiments.search.terrain import PLANE
from uavrt_experiments.search.world import World

FLAVOURS: tuple[Flavour, ...] = ("px4", "ardupilot")
"""Autopilots of runs with even and with odd seeds."""
STEP_S = 0.05
_STEPS = round(1.0 / STEP_S)
_START_GAP_M = 30.0
"""Distance between drones that start at one corner [m]."""
_HEARD_DB = 11.4
"""SNR from which a drone expects to detect single pulses [dB]; a table's threshold is set to
it."""
_ALL_HEARD_DB = 200.0
"""Offset added to a table's levels if every pulse is received [dB]."""
_FENCE_M, _BATTERY_WH = 5000.0, 1e6
_GREETING_S = 3.0
"""Time in which several drones receive each other's courses before they begin [s]."""
_BETWEEN = np.linspace(0.0, 1.0, 11)


class Aircraft(Protocol):
    """Interface of a simulated drone that executes its pilot's commands."""

    vehicle: FlyingVehicle
    execution: OrderExecution | None
    time_s: float

    def now(self) -> VehicleNow | None:
        """Present state as the guide receives it."""

    def step(self) -> None:
        """Advance the drone by `STEP_S`."""

    def confirm(self, order: Order) -> None:
        """Confirm an order as the operator."""


Maker = Callable[[Flavour, Frame, Limits, VehicleState], Aircraft]
"""Makes a drone that hovers at a place."""


class Direct:
    """An aircraft whose autopilot executes each command at once, without any takeover."""

    def __init__(
        self, flavour: Flavour, frame: Frame, limits: Limits, start: VehicleState
    ) -> None:
        plane = TangentPlane(
            latitude_deg=PLANE.latitude_deg,
            longitude_deg=PLANE.longitude_deg,
            altitude_amsl_m=0.0,
        )
        self.vehicle = FlyingVehicle(
            flavour,
            plane,
            frame,
            north_m=start.north_m,
            east_m=start.east_m,
            height_m=start.height_m,
            yaw_deg=wrap_degrees_360(start.yaw_deg),
        )
        self.vehicle.set_mode(MODES[flavour]["hold"])
        self.execution: OrderExecution | None = None
        self.time_s = 0.0
        self._sent, self._turned_deg = 0, 0.0

    def now(self) -> VehicleNow:
        """Present state of the drone, as the guide receives it."""
        vehicle, plane = self.vehicle, self.vehicle.plane
        latitude, longitude = vehicle.latitude_longitude()
        return VehicleNow(
            time_s=self.time_s,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_amsl_m=plane.altitude_amsl_m + vehicle.body.shown_height_m,
            altitude_relative_m=vehicle.body.shown_height_m,
            speed_m_s=math.hypot(*vehicle.body.velocity_m_s[:2]),
            yaw_deg=vehicle.heading.yaw_deg,
            home=(plane.latitude_deg, plane.longitude_deg),
            battery_percent=100.0,
            order_id=None if self.execution is None else self.execution.order.order_id,
            began=self._sent > 0,
            obeyed=True,
            requests_sent=self._sent,
            requests_refused=0,
            turned_deg=self._turned_deg,
            ground_silent_s=0.0,
        )

    def step(self) -> None:
        """Advance the drone by `STEP_S`."""
        self.time_s += STEP_S
        self.vehicle.advance(STEP_S)
        self._turned_deg += abs(self.vehicle.heading.rate_deg_s) * STEP_S
        manoeuvre = None if self.execution is None else self.execution.next(self.now())
        if manoeuvre is not None:
            self._sent, self._turned_deg = self._sent + 1, 0.0
            command = command_message(_command_of(manoeuvre), 1)
            assert isinstance(command, dialect.CommandInt | dialect.CommandLong)
            self.vehicle.command(command)

    def confirm(self, order: Order) -> None:
        """Confirm an order as the operator."""


def _command_of(manoeuvre: Manoeuvre) -> VehicleCommand:
    match manoeuvre:
        case FlyThere():
            return VehicleCommand(
                name="DO_REPOSITION",
                param1=-1.0,
                param4=math.nan
                if manoeuvre.yaw_deg is None
                else math.radians(manoeuvre.yaw_deg),
                x=round(manoeuvre.latitude_deg * 1e7),
                y=round(manoeuvre.longitude_deg * 1e7),
                z_m=manoeuvre.altitude_amsl_m,
            )
        case TurnInPlace():
            return VehicleCommand(
                name="CONDITION_YAW",
                param1=abs(manoeuvre.turn_deg),
                param2=manoeuvre.rate_deg_s,
                param3=math.copysign(1.0, manoeuvre.turn_deg),
                param4=1.0,
            )
        case _:
            return VehicleCommand(name="NAV_RETURN_TO_LAUNCH")


def starts_of(scenario: Scenario, contender: Contender) -> dict[int, VehicleState]:
    """Start places of the drones, by number; each is 10 m above the one before."""
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


def limits_of(scenario: Scenario) -> Limits:
    """Guidance settings of a drone that flies a table's scenario."""
    rule = scenario.keep_away
    return Limits(
        lowest_m=5.0,
        highest_m=500.0,
        fence_m=_FENCE_M,
        speed_m_s=scenario.vehicle.speed_m_s,
        battery_wh=_BATTERY_WH,
        keep_away_m=0.0 if rule is None else rule.radius_m,
    )


def raised_db(scenario: Scenario) -> float:
    """Offset from a table's levels to the SNR in a drone's detector [dB]."""
    threshold = scenario.truth.threshold_db
    return _HEARD_DB - threshold if threshold > -_ALL_HEARD_DB else _ALL_HEARD_DB


class _AtOnce(SearchThread):
    """Runs each planning job of the search immediately, without a thread."""

    def _start(self) -> None:
        pass

    def _put(self, job: Callable[[], object] | None) -> None:
        if job is not None:
            self._do(job)  # type: ignore[arg-type]


class Drone:
    """One drone of a search, and its received pulses.

    `number`: number of the drone, from 0.
    """

    def __init__(
        self,
        number: int,
        aircraft: Aircraft,
        order: Order,
        tags: tuple[Tag, ...],
        limits: Limits,
        equipment: Equipment,
    ) -> None:
        self.number, self.aircraft, self._order, self._tags = number, aircraft, order, tags
        self._limits, self._equipment = limits, equipment
        self.shared = SharedSearch(1000 * (number + 1))
        self.found: dict[int, tuple[float, float, float]] = {}
        """Latitude, longitude [deg] and 95 % radius [m] of tags found since the last check."""
        self.decision_s: list[float] = []
        self._planner: _AtOnce | None = None
        self._execution: OrderExecution | None = None
        self._course_s = -math.inf

    @property
    def state(self) -> VehicleState:
        """Present state of the drone."""
        vehicle = self.aircraft.vehicle
        north, east = vehicle.body.place_m
        return VehicleState(
            time_s=self.aircraft.time_s,
            east_m=east,
            north_m=north,
            height_m=vehicle.body.shown_height_m,
            yaw_deg=vehicle.heading.yaw_deg,
        )

    @property
    def time_ns(self) -> int:
        """Time on the drone's clock."""
        return ns_from_s(self.aircraft.time_s)

    def begin(self) -> None:
        """Give and confirm the order to search."""
        now, order = self.aircraft.now(), self._order
        assert now is not None
        self.shared.begin(now.time_s)
        self.shared.check(now, order.height_m or now.altitude_relative_m)
        behaviour = BEHAVIOURS[self.aircraft.vehicle.flavour]
        search_run = SearchRun(order, self._tags, now, self._limits, behaviour, self._equipment)
        self.aircraft.confirm(order)
        self._execution = OrderExecution(order, search_run.plan, self._limits, waits=True)
        self.aircraft.execution = self._execution
        self._planner = _AtOnce(search_run)
        self._planner.begin(self.time_ns, now)
        self._take_thoughts(now)
        self.shared.go((now.latitude_deg, now.longitude_deg))

    def hear(self, tag: Tag, snr_db: float | None) -> None:
        """Receive a pulse, or the report that none was found."""
        assert self._planner is not None
        time_ns, vehicle = self.time_ns, self.aircraft.vehicle
        if snr_db is not None:
            latitude, longitude = vehicle.latitude_longitude()
            pose = Pose(
                time_ns=time_ns,
                latitude_deg=latitude,
                longitude_deg=longitude,
                altitude_amsl_m=vehicle.plane.altitude_amsl_m + vehicle.body.shown_height_m,
                altitude_relative_m=vehicle.body.shown_height_m,
                quaternion_wxyz=from_euler_deg(vehicle.heading.yaw_deg, 0.0, 0.0),
            )
            self._planner.pulse(PulsePose(pulse=_pulse(tag, time_ns, snr_db), pose=pose))
        self._planner.searched(
            SearchReport(
                tag_id=tag.tag_id,
                time_ns=time_ns,
                frequency_hz=tag.frequency_hz,
                noise_psd=1e-9,
                best_score=0.1,
            )
        )

    def decide(self) -> None:
        """Decide where to fly if a decision is due, as the guide does."""
        now, planner, execution = self.aircraft.now(), self._planner, self._execution
        if now is None or planner is None or execution is None:
            return
        execution.shared = self.shared.has_others(now.time_s)
        planner.place(self.time_ns, now)
        if self.shared.waits:
            self._await_path(planner, now)
        elif (
            now.began and execution.ended is None and planner.is_time(now, idle=execution.idle)
        ):
            others, began = self.shared.begin_decision(now.time_s), time.process_time()
            planner.request_decision(self.time_ns, now, idle=execution.idle, others=others)
            self.decision_s.append(time.process_time() - began)
            self._take_thoughts(now)

    def _take_thoughts(self, now: VehicleNow) -> None:
        assert self._planner is not None
        for choice in self._planner.results():
            if not isinstance(choice, Choice):
                raise TypeError(f"the search failed: {choice}")
            self._note_found(choice)
            if choice.leg is None or self.shared.choose(choice, now):
                self._redirect(choice, now)
            else:
                self._course_s = -math.inf

    def _await_path(self, planner: _AtOnce, now: VehicleNow) -> None:
        answer = self.shared.answer(now)
        if answer is None:
            return
        choice, given = answer
        if given:
            self._redirect(choice, now)
        else:
            planner.withdraw(now)
        self._course_s = -math.inf

    def _redirect(self, choice: Choice, now: VehicleNow) -> None:
        assert self._execution is not None
        if choice.steps is not None:
            self._execution.redirect(choice.steps, now)

    def _note_found(self, choice: Choice) -> None:
        for note in choice.notes:
            for sought in note.tags:
                if note.event == "found" and sought.tag_id == note.tag_id:
                    place = (sought.latitude_deg, sought.longitude_deg, sought.radius95_m)
                    self.found[sought.tag_id] = place

    def send_course(self, ways: PathAssignments) -> bool:
        """Send the drone's course to the station when due; True if others need it now."""
        now, shared = self.aircraft.now(), self.shared
        if now is None or not shared.must_report(now.time_s):
            return False
        every_s = PATH_REQUEST_S if shared.waits else COURSE_S
        if now.time_s - self._course_s < every_s:
            return False
        self._course_s = now.time_s
        searching = self._planner is not None
        course = shared.course(now, searching=searching, height_m=self._order.height_m)
        return ways.receive_course(self.number + 1, course, now.time_s)


def _pulse(tag: Tag, time_ns: int, snr_db: float) -> Pulse:
    return Pulse(
        tag_id=tag.tag_id,
        frequency_hz=tag.frequency_hz,
        start_time_ns=time_ns - 10_000_000,
        end_time_ns=time_ns + 10_000_000,
        snr_db=snr_db,
        group_snr_db=snr_db,
        score=2.0,
        group_index=1,
        group_sequence=1,
        noise_psd=1e-9,
        detection_status="confirmed",
        confirmed=True,
        rate=1,
        predicted_next_start_ns=None,
        predicted_next_end_ns=None,
    )


class FlightOfDrones:
    """Drones that search a world until every tag is found or the time is over.

    `contender`: planner, number and start places of the drones.
    `make`: makes each drone; `Direct` executes commands at once.
    """

    def __init__(
        self, scenario: Scenario, contender: Contender, seed: int, make: Maker = Direct
    ) -> None:
        self.scenario, self.seed = scenario, seed
        self.world = World(scenario, seed)
        self.least = LeastErrors(scenario, self.world)
        self._raised_db = raised_db(scenario)
        flavour, limits = FLAVOURS[seed % 2], limits_of(scenario)
        frame = Frame(
            speed_m_s=limits.speed_m_s, battery_wh=_BATTERY_WH, fence_m=limits.fence_m
        )
        self._tags = tuple(
            Tag(
                tag_id=tag_id,
                frequency_hz=FREQUENCY_HZ + 1e4 * tag_id,
                pulse_width_s=0.02,
                pulse_intervals_s=(1.0,),
                interval_uncertainty_s=0.0,
                interval_jitter_s=0.0,
                k=1,
            )
            for tag_id in self.world.tag_ids
        )
        priors = priors_of(scenario, self.world)
        equipment = Equipment(
            pattern=pattern_of(scenario.truth),
            hills=map_of(scenario),
            known={
                tag.tag_id: replace(prior, level_db=prior.level_db + self._raised_db)
                for tag, prior in zip(self._tags, priors, strict=True)
            },
        )
        self.drones = []
        for number, start in starts_of(scenario, contender).items():
            aircraft = make(flavour, frame, limits, start)
            order = self._order(aircraft.vehicle.plane, start.height_m)
            one = replace(equipment, seed=seed * 10 + number)
            self.drones.append(Drone(number, aircraft, order, self._tags, limits, one))
        self._ways, self._sent_s = PathAssignments(), -math.inf
        self.second = 0
        self.judged: list[Judged] = []
        self.paths = [[(one.state.east_m, one.state.north_m)] for one in self.drones]
        self.nearest_m = self.apart_m = math.inf
        self.too_near_s = 0
        self._clear: set[int] = set()

    def _order(self, plane: TangentPlane, height_m: float) -> Order:
        scenario = self.scenario
        east, north = scenario.east_m, scenario.north_m
        corners = ((0.0, 0.0), (0.0, east), (north, east), (north, 0.0))
        return Order(
            order_id=1,
            action="search",
            places=tuple(plane.to_geodetic(*corner) for corner in corners),
            height_m=height_m,
            accuracy_m=scenario.our_stop.radius95_m,
            duration_s=float(scenario.limit_s),
        )

    def flown(self) -> Outcome:
        """Fly the search and return its outcome."""
        if len(self.drones) > 1:
            for _ in range(round(_GREETING_S / STEP_S)):
                self._step()
        for one in self.drones:
            one.begin()
        while not self._done():
            for _ in range(_STEPS):
                self._step()
            self._pass_second()
        there = [one for one in self.judged if self.world.exists(one.tag_id)]
        ways = [np.hypot(*np.diff(np.array(path), axis=0).T).sum() for path in self.paths]
        return Outcome(
            seed=self.seed,
            time_s=float(self.second),
            distance_m=float(sum(ways)),
            judged=tuple(self.judged),
            lost=self.scenario.tags - len(there),
            nearest_m=self.nearest_m,
            too_near_s=self.too_near_s,
            decision_s=tuple(spent for one in self.drones for spent in one.decision_s),
            path_m=self._ways_m(),
            ends_m=tuple((float(x), float(y)) for x, y in self.world.places_m),
            apart_m=self.apart_m,
        )

    def _ways_m(self) -> tuple[tuple[float, float], ...]:
        """Positions of all drones over time [m], with a gap after each but the last."""
        first, *others = self.paths
        more = (place for path in others for place in ((np.nan, np.nan), *path))
        return (*first, *more)

    def _done(self) -> bool:
        found = sum(self.world.exists(one.tag_id) for one in self.judged)
        return found == self.scenario.tags or self.second >= self.scenario.limit_s

    def _step(self) -> None:
        news = False
        for one in self.drones:
            one.aircraft.step()
            one.decide()
            self._judge(one)
            if len(self.drones) > 1:
                news |= one.send_course(self._ways)
        time_s = self.drones[0].aircraft.time_s
        if len(self.drones) > 1 and (news or time_s >= self._sent_s + COURSE_S):
            self._sent_s = time_s
            for one in self.drones:
                for report in self._ways.reports_for(one.number + 1, time_s):
                    one.shared.receive(report, time_s)

    def _pass_second(self) -> None:
        self.second += 1
        self.world.advance(self.second)
        states = [one.state for one in self.drones]
        self.least.hear(states)
        for one, state, path in zip(self.drones, states, self.paths, strict=True):
            path.append((state.east_m, state.north_m))
            self._note_nearest(one.number, state)
            for tag, heard in zip(
                self._tags, self.world.heard(self.second, state, one.number), strict=True
            ):
                level = heard.level_db
                one.hear(tag, None if level is None else level + self._raised_db)
        self._note_apart()

    def _note_nearest(self, number: int, state: VehicleState) -> None:
        rule, places = self.scenario.keep_away, self.world.places_m
        off = float(np.hypot(places[:, 0] - state.east_m, places[:, 1] - state.north_m).min())
        self.nearest_m = min(self.nearest_m, off)
        near = rule is not None and off < rule.radius_m
        # A drone that starts next to an animal first leaves it.
        self._clear |= set() if near else {number}
        self.too_near_s += int(near and number in self._clear)

    def _note_apart(self) -> None:
        ends = [np.array(path[-2:]) for path in self.paths]
        last = [begin + _BETWEEN[:, None] * (end - begin) for begin, end in ends]
        for number, mine in enumerate(last):
            for other in last[:number]:
                off = np.hypot(*(mine - other).T)
                self.apart_m = min(self.apart_m, float(off.min()))

    def _judge(self, drone: Drone) -> None:
        known = {one.tag_id for one in self.judged}
        for tag_id, (latitude, longitude, radius) in drone.found.items():
            if tag_id in known:
                continue
            north, east = drone.aircraft.vehicle.plane.to_local(latitude, longitude)
            error = None
            if self.world.exists(tag_id):
                x, y = self.world.places_m[tag_id - 1]
                error = math.hypot(east - x, north - y)
            self.judged.append(
                Judged(
                    tag_id=tag_id,
                    time_s=float(self.second),
                    error_m=error,
                    radius95_m=radius,
                    information=self.least.of(tag_id),
                )
            )
        drone.found.clear()
