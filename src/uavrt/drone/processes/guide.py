"""The guide process: plans motion orders, proposes them, and flies confirmed ones.

The guide requests each motion from the connection process, which detects takeovers. A restarted
guide has no order, so nothing continues without confirmation.
"""

import secrets
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from uavrt.config.settings import GuidanceSettings, Settings
from uavrt.core.clock import monotonic_s
from uavrt.core.earth.geodesy import distance_m
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import ConfigError, PlanError, UavrtError
from uavrt.core.foreign import SHAPES, read_file
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    FlightInfo,
    GoHome,
    KeepOut,
    MotionOffer,
    MotionRequest,
    Neighbour,
    PulsePose,
    SearchNote,
    SearchReport,
    Tag,
    VehicleFence,
    VehicleReport,
    VehicleRequest,
)
from uavrt.core.runtime.heap import heap_of_short_arrays
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.processes.search_thread import SearchFailed, SearchThread
from uavrt.guidance.autopilot_behaviour import behaviour_of
from uavrt.guidance.energy_learning import EnergyLearning
from uavrt.guidance.files.area_text import keep_out_in
from uavrt.guidance.ground_heights import GroundAround
from uavrt.guidance.operator_orders import Limits, Order, VehicleNow
from uavrt.guidance.order_execution import OrderExecution
from uavrt.guidance.plans import plan_of
from uavrt.guidance.safety import SAFETY
from uavrt.guidance.search.search_run import Choice, SearchRun
from uavrt.guidance.search.search_task import Equipment
from uavrt.guidance.search.shared_search import SharedSearch
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.guidance.vehicle_reports import now_of
from uavrt.link.tunnel.own_messages.motion_messages import cut_text
from uavrt.localization.antenna import MONOPOLE, pattern_named

if TYPE_CHECKING:
    from uavrt.localization.terrain.hill_losses import HillLosses

log = get_logger()

Found = TypeVar("Found")
RunInBackground = Callable[[Callable[[], None]], None]
"""Function that runs slow work in the background, such as in a thread, and returns at once."""

TICK_S = 0.05
ALIVE_S = 0.5
COURSE_S, PATH_REQUEST_S = 1.0, 0.4
"""Time between reports of the drone's course [s]: normally, and while a path is requested."""
MOST_WAITING_ORDERS = 8
"""Largest number of orders waiting to be planned."""


def limits_of(settings: GuidanceSettings) -> Limits:
    """Return the flight limits that the settings and the keep-out file define.

    Raises `ConfigError` or `FormatError`.
    """
    own = {one.name: getattr(settings, one.name) for one in fields(settings)}
    return Limits(**own, keep_out=keep_out_of(settings))


def ground_of(settings: GuidanceSettings, home: tuple[float, float]) -> GroundAround | None:
    """Read the terrain heights around home; None if no elevation file is configured.

    Raises `FormatError` or `PlanError`.
    """
    if settings.terrain is None:
        return None
    from uavrt.localization.terrain.elevation_files import open_elevation

    plane = TangentPlane(latitude_deg=home[0], longitude_deg=home[1])
    heights_at = open_elevation(Path(settings.terrain)).heights_m
    return GroundAround.around(heights_at, plane, settings.fence_m)


def fenced(limits: Limits, fence: VehicleFence | None) -> Limits:
    """Return the limits with the autopilot's geofence added.

    Raises `PlanError` if the fence is unusable.
    """
    if fence is None:
        return limits
    if fence.fault is not None:
        raise PlanError(fence.fault)
    return replace(limits, stay_in=fence.within, keep_out=(*limits.keep_out, *fence.keep_out))


def hills_of(settings: GuidanceSettings, home: tuple[float, float]) -> "HillLosses | None":
    """Return a model of the signal loss behind hills; None without an elevation file.

    Raises `FormatError`.
    """
    if settings.terrain is None:
        return None
    from uavrt.localization.terrain.elevation_files import open_elevation
    from uavrt.localization.terrain.hill_losses import HillLosses

    elevation = open_elevation(Path(settings.terrain))
    return HillLosses(
        elevation, latitude_deg=home[0], longitude_deg=home[1], tag_m=SEARCH_RULES.tag_height_m
    )


def keep_out_of(settings: GuidanceSettings) -> tuple[KeepOut, ...]:
    """Read the areas that the drone must not fly over from the configured file.

    Raises `ConfigError` or `FormatError`.
    """
    name = settings.keep_out_file
    if name is None:
        return ()
    try:
        text = read_file(name, SHAPES).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"guidance.keep_out_file {name} cannot be read: {error}",
            remedy="Put the file on the drone, or remove the setting",
        ) from error
    return keep_out_in(text, name, every=True)


def equipment_of(settings: Settings) -> Equipment:
    """Return the antenna, detector and planner settings for a search.

    Raises `UsageError` for an unknown antenna.
    """
    antenna = settings.bearings.antenna
    return Equipment(
        pattern=None if antenna == MONOPOLE else pattern_named(antenna),
        yaw_offset_deg=settings.antenna.yaw_offset_deg,
        k=settings.detection.k,
        planner=settings.guidance.planner,
        seed=secrets.randbits(31),
    )


def _height_m(order: Order, now: VehicleNow) -> float:
    return now.altitude_relative_m if order.height_m is None else order.height_m


@dataclass(frozen=True, slots=True, kw_only=True)
class _OrderRequest:
    """An order to plan, with the vehicle's state, fence and tags at its arrival."""

    request: MotionRequest
    order: Order
    vehicle: VehicleReport
    now: VehicleNow
    fence: VehicleFence | None
    tags: tuple[Tag, ...]
    settings: Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class _Planned:
    """A planned order, ready to be proposed to the operator."""

    home: tuple[float, float]
    execution: OrderExecution
    limits: Limits
    search_run: SearchRun | None
    summary: str


class _Planning:
    """Plans an order in the background.

    Reading elevation files takes seconds. Such a silence of the guide process would end the
    order being flown.
    """

    def __init__(self, asked: _OrderRequest, in_background: RunInBackground) -> None:
        self.asked = asked
        self.found: _Planned | str | None = None
        """The plan, or a text on why no plan was found; None while planning."""
        in_background(self._run)

    def _run(self) -> None:
        self.found = _attempt(lambda: _plan(self.asked))


def _plan(asked: _OrderRequest) -> _Planned:
    guidance, order, now = asked.settings.guidance, asked.order, asked.now
    behaviour = behaviour_of(asked.vehicle.autopilot)
    ground = ground_of(guidance, now.home)
    limits = fenced(replace(limits_of(guidance), ground=ground), asked.fence)
    search_run = None
    if order.action == "search":
        hills = hills_of(guidance, now.home)
        equipment = replace(equipment_of(asked.settings), hills=hills)
        search_run = SearchRun(order, asked.tags, now, limits, behaviour, equipment)
        plan = search_run.plan
    else:
        plan = plan_of(order, now, limits, behaviour)
        order = replace(order, height_m=_height_m(order, now))
    unknown = "" if asked.fence is not None else "; geofence unknown"
    return _Planned(
        home=now.home,
        execution=OrderExecution(order, plan, limits, waits=search_run is not None),
        limits=limits,
        search_run=search_run,
        summary=cut_text(plan.summary, f"{unknown}; in mode {asked.vehicle.mode}"),
    )


def _attempt(make: Callable[[], Found]) -> Found | str:
    """Call `make`; return its result or the text of its error. Unexpected errors are logged."""
    try:
        return make()
    except UavrtError as error:
        return str(error)
    except Exception as error:
        log.exception("planning a motion order failed; the order is refused")
        return f"the order cannot be planned: {type(error).__name__}: {error}"


def in_thread(work: Callable[[], None]) -> None:
    """Run `work` in a new thread."""
    threading.Thread(target=work, name="plan", daemon=True).start()


class Guide:
    """Plans and flies motion orders; all its inputs are records from the supervisor."""

    def __init__(
        self,
        frame: ProcessFrame,
        in_background: RunInBackground = in_thread,
        planner: Callable[[SearchRun], SearchThread] = SearchThread,
    ) -> None:
        self._frame = frame
        self._in_background, self._make_planner = in_background, planner
        guidance = frame.assignment.settings.guidance
        self._energy_learning = EnergyLearning(guidance.hover_w, guidance.battery_wh)
        """Estimate of the flight power, learned from the battery over all orders."""
        self._vehicle: VehicleReport | None = None
        self._fence: VehicleFence | None = None
        self._execution: OrderExecution | None = None
        self._offered: _Planned | None = None
        self._waiting_orders: deque[tuple[MotionRequest, Order]] = deque()
        self._planning: _Planning | None = None
        self._planner: SearchThread | None = None
        self._ending: list[SearchThread] = []
        """Ended searches whose summary is not recorded yet."""
        flight = frame.assignment.flight
        self._tags: tuple[Tag, ...] = () if flight is None else flight.tags
        self._alive_s = self._course_s = 0.0
        self._shared = SharedSearch(secrets.randbits(16))
        self.offers = self.flown = self.decisions = self.paths_refused = 0
        frame.send("vehicle_request", VehicleRequest(order_id=None, ends=True))

    def receive(self, topic: str, record: object) -> None:
        """Handle a record from the supervisor: order, vehicle, other drone, flight or pulse."""
        match record:
            case VehicleReport():
                self._vehicle = record
                self._fly(record)
            case VehicleFence():
                self._fence = record
            case MotionRequest():
                self._offer(record)
            case Neighbour():
                self._shared.receive(record, monotonic_s())
            case FlightInfo():
                self._tags = record.tags if topic == "flight" else ()
            case PulsePose() if self._planner is not None:
                self._planner.pulse(record)
            case SearchReport() if self._planner is not None:
                self._planner.searched(record)

    def _offer(self, request: MotionRequest) -> None:
        order = Order.of(request, secrets.randbits(31) | 1)
        if len(self._waiting_orders) >= MOST_WAITING_ORDERS:
            busy = "too many orders are being planned. Request the motion again"
            self._send_offer(request, order.order_id, busy, "", refused=True)
            return
        self._waiting_orders.append((request, order))
        self._plan_next()

    def _plan_next(self) -> None:
        while self._waiting_orders and self._planning is None:
            request, order = self._waiting_orders.popleft()
            asked = _attempt(partial(self._checked_request, request, order))
            if isinstance(asked, str):
                self._send_offer(request, order.order_id, asked, "", refused=True)
            else:
                self._planning = _Planning(asked, self._in_background)

    def _checked_request(self, request: MotionRequest, order: Order) -> _OrderRequest:
        """Check everything about an order that needs no plan; raises `UavrtError`."""
        vehicle = self._vehicle
        if vehicle is None:
            raise UavrtError("no contact with the vehicle", remedy="Check the autopilot's link")
        taking_off = order.action == "takeoff"
        fault = vehicle.takeoff_fault if taking_off else vehicle.fault
        if fault is not None:
            raise UavrtError(fault)
        behaviour_of(vehicle.autopilot)
        now = self._now(vehicle, monotonic_s())
        if now is None:
            raise UavrtError("the vehicle's position or home is unknown", remedy="Wait for GPS")
        if order.action == "search":
            self._shared.check(now, _height_m(order, now))
        return _OrderRequest(
            request=request,
            order=order,
            vehicle=vehicle,
            now=now,
            fence=self._fence,
            tags=self._tags,
            settings=self._frame.assignment.settings,
        )

    def _take_plan(self) -> None:
        planning = self._planning
        if planning is None or planning.found is None:
            return
        self._planning = None
        asked, found = planning.asked, planning.found
        number = asked.order.order_id
        if isinstance(found, _Planned):
            self._offered = found
            self.offers += 1
            self._send_offer(asked.request, number, found.summary, asked.vehicle.mode)
        else:
            self._send_offer(asked.request, number, found, "", refused=True)
        self._plan_next()

    def _send_offer(
        self,
        request: MotionRequest,
        order_id: int,
        summary: str,
        mode: str,
        *,
        refused: bool = False,
    ) -> None:
        self._frame.send(
            "motion_offer",
            MotionOffer(
                request_id=request.request_id,
                requester=request.requester,
                order_id=order_id,
                nonce=secrets.randbits(63),
                summary=summary.encode("utf-8", "replace").decode(),
                mode=mode,
                refused=refused,
                takeoff=request.action == "takeoff",
            ),
        )

    def _fly(self, vehicle: VehicleReport) -> None:
        now_s = monotonic_s()
        now = self._now(vehicle, now_s)
        self._fly_order(vehicle, now, now_s)
        if now is not None:
            self._report_course(now, now_s)

    def _now(self, vehicle: VehicleReport, now_s: float) -> VehicleNow | None:
        now = now_of(vehicle, now_s)
        return None if now is None else self._energy_learning.learn(now)

    def _fly_order(self, vehicle: VehicleReport, now: VehicleNow | None, now_s: float) -> None:
        """If an order is confirmed, send the request for its next motion when that is due."""
        offered = self._offered
        if offered is not None and vehicle.order_id == offered.execution.order.order_id:
            self._begin(offered, vehicle, now)
        execution = self._execution
        if execution is None or vehicle.order_id != execution.order.order_id:
            self._execution = None
            self._end_search(now, vehicle.reason)
            return
        if now is not None and self._planner is not None:
            self._search(self._planner, execution, now)
        manoeuvre = None if now is None else execution.next(now)
        text = f"{execution.plan.summary}: {execution.status_text or execution.progress}"
        if self._planner is not None:
            text = execution.status_text
        if now is not None and (isinstance(manoeuvre, GoHome) or execution.returning):
            self._shared.go(now.home, returning=True)
        order_id = execution.order.order_id
        if manoeuvre is None and execution.ended is not None:
            self._end(order_id, execution.ended)
            self._execution = None
            self._end_search(now, execution.ended)
        elif manoeuvre is not None or now_s - self._alive_s >= ALIVE_S:
            self._alive_s = now_s
            request = VehicleRequest(order_id=order_id, manoeuvre=manoeuvre, status_text=text)
            self._frame.send("vehicle_request", request)

    def _begin(self, offered: _Planned, vehicle: VehicleReport, now: VehicleNow | None) -> None:
        self._end_search(now, "another order was confirmed")
        self._execution = self._offered = None
        if now is None:
            return
        order, search_run = offered.execution.order, offered.search_run
        self.flown += 1
        execution = _attempt(lambda: self._plan_again(offered, vehicle, now))
        if isinstance(execution, str):
            self._end(order.order_id, execution)
            return
        self._execution = execution
        if search_run is not None:
            self._planner = self._make_planner(search_run)
            self._planner.begin(self._frame.clock.now_ns(), now)

    def _plan_again(
        self, offered: _Planned, vehicle: VehicleReport, now: VehicleNow
    ) -> OrderExecution:
        """Plan the order again at its confirmation; raises `PlanError` if it became impossible.

        Fence, terrain and return path are those of the first plan, so home must still be the
        same.
        """
        if distance_m(*offered.home, *now.home) > SAFETY.home_moved_m:
            raise PlanError(
                "home was moved while the order was planned", remedy="Request the motion again"
            )
        execution, search_run = offered.execution, offered.search_run
        self._shared.begin(now.time_s)
        if search_run is not None:
            self._shared.check(now, _height_m(execution.order, now))
            search_run.check(now)
            return execution
        plan = plan_of(execution.order, now, offered.limits, behaviour_of(vehicle.autopilot))
        return OrderExecution(execution.order, plan, offered.limits)

    def _report_course(self, now: VehicleNow, now_s: float) -> None:
        shared, execution = self._shared, self._execution
        every_s = PATH_REQUEST_S if shared.waits else COURSE_S
        if not shared.must_report(now_s) or now_s - self._course_s < every_s:
            return
        self._course_s = now_s
        height, searching = None, self._planner is not None and execution is not None
        if execution is not None and searching:
            height = _height_m(execution.order, now)
        course = shared.course(now, searching=searching, height_m=height)
        self._frame.send("course", course)

    def _end(self, order_id: int, reason: str) -> None:
        log.info("motion order ended", order=order_id, reason=reason)
        self._frame.send(
            "vehicle_request", VehicleRequest(order_id=order_id, ends=True, status_text=reason)
        )

    def _search(
        self, planner: SearchThread, execution: OrderExecution, now: VehicleNow
    ) -> None:
        time_ns = self._frame.clock.now_ns()
        execution.shared = self._shared.has_others(now.time_s)
        planner.place(time_ns, now)
        for result in planner.results():
            match result:
                case Choice():
                    self._choose(result, execution, now)
                case SearchFailed():
                    execution.give_up(result.reason)
        shared = self._shared
        if shared.waits:
            self._await_path(planner, execution, now)
        elif (
            now.began and execution.ended is None and planner.is_time(now, idle=execution.idle)
        ):
            others = shared.begin_decision(now.time_s)
            planner.request_decision(time_ns, now, idle=execution.idle, others=others)

    def _choose(self, choice: Choice, execution: OrderExecution, now: VehicleNow) -> None:
        """Fly a search decision.

        If other drones search too, first request its path from the ground.
        """
        if choice.steps is None or choice.leg is None or self._shared.choose(choice, now):
            self._follow(choice, choice.notes, execution, now)
            return
        self._note([note for note in choice.notes if note.event != "decision"])
        self._course_s = 0.0

    def _await_path(
        self, planner: SearchThread, execution: OrderExecution, now: VehicleNow
    ) -> None:
        """Fly the requested path once it is assigned; if it is refused, decide again."""
        answer = self._shared.answer(now)
        if answer is None:
            return
        choice, given = answer
        if given:
            decided = [note for note in choice.notes if note.event == "decision"]
            self._follow(choice, decided, execution, now)
        else:
            self.paths_refused += 1
            planner.withdraw(now)
        self._course_s = 0.0

    def _follow(
        self,
        choice: Choice,
        notes: Sequence[SearchNote],
        execution: OrderExecution,
        now: VehicleNow,
    ) -> None:
        self._note(notes)
        execution.status_text = choice.status_text
        if choice.steps is not None:
            execution.redirect(choice.steps, now)

    def _note(self, notes: Sequence[SearchNote]) -> None:
        for note in notes:
            self.decisions += note.event == "decision"
            self._frame.send("search_note", note)
            log.info("search report", what=note.event, text=note.text, reason=note.reason)
            if note.event != "decision":
                self._frame.notify(5, f"Search: {note.text}")

    def _end_search(self, now: VehicleNow | None, reason: str) -> None:
        planner, self._planner = self._planner, None
        self._shared.end()
        if planner is None:
            return
        if now is not None:
            planner.end(self._frame.clock.now_ns(), now, reason)
        self._ending.append(planner)

    def tick(self) -> None:
        """Propose orders that are now planned, and record the summaries of ended searches."""
        self._take_plan()
        for planner in self._ending:
            for result in planner.results():
                if isinstance(result, Choice):
                    self._note([note for note in result.notes if note.event == "found"])
                elif isinstance(result, SearchNote):
                    self._note([result])
        self._ending = [one for one in self._ending if not one.over]

    @property
    def status(self) -> str:
        """State of the process as a short text."""
        if self._vehicle is None:
            return "waiting for autopilot"
        return "ready" if self._execution is None else "flying"

    def counters(self) -> dict[str, float]:
        """Counts of orders and decisions, for the health report."""
        return {
            "orders_offered": self.offers,
            "orders_flown": self.flown,
            "search_decisions": self.decisions,
            "ways_not_given": self.paths_refused,
            "lessons_of_power": self._energy_learning.learnt,
            "hover_w": round(self._energy_learning.energy.power_w(0.0)),
            "other_drones": len(self._shared.others(monotonic_s())),
        }


def main() -> None:
    """Plan and fly orders until the supervisor ends the process."""
    heap_of_short_arrays()
    with ProcessFrame.start() as frame:
        guide = Guide(frame)
        while frame.running:
            for topic, record in frame.receive(timeout_s=TICK_S):
                guide.receive(topic, record)
            guide.tick()
            frame.report(guide.status, counters=guide.counters)


if __name__ == "__main__":
    main()
