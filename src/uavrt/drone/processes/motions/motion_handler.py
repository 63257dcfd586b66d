"""Connect motion orders, the autopilot's messages and the commands to the autopilot.

Part of the connection process. `Authority` gets the autopilot's messages before anything else
uses them. Requests of the guide become commands here or are dropped. Orders must be sealed
(authenticated), except for a simulator on this computer.
"""

from collections.abc import Callable, Mapping

from uavrt.config.settings import GuidanceSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.messages import VehicleRequest
from uavrt.drone.processes.motions.fence_watch import FenceWatch
from uavrt.drone.processes.motions.motion_control import (
    MotionControl,
    MotionOutputs,
    Requester,
    TakeBack,
)
from uavrt.drone.processes.motions.motion_orders import MotionOrders, NeighbourReports
from uavrt.drone.processes.motions.motion_reports import MotionReports
from uavrt.drone.processes.motions.reported_autopilot import ReportedAutopilot
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.control.observed import AutopilotStarted
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import observations
from uavrt.link.mavlink.links.address import Address
from uavrt.link.mavlink.message import Message


class MotionHandler:
    """Passes the autopilot's messages and the guide's requests to their handlers."""

    def __init__(
        self,
        settings: GuidanceSettings,
        outlets: MotionOutputs,
        *,
        own_place: Callable[[], tuple[int, int]],
        next_request_id: Callable[[], int],
        autopilot_link: Address | None,
    ) -> None:
        self._out, self._own_place = outlets, own_place
        self._fence = FenceWatch(
            outlets.command, lambda fence: outlets.record("vehicle_fence", fence), own_place
        )
        self._autopilot = autopilot = ReportedAutopilot(autopilot_link)
        self.control = control = MotionControl(
            settings, outlets, own_place, lambda now_s: self._reports.standing_changed(now_s)
        )
        self._take_back = stop = TakeBack(settings, control)
        self._reports = reports = MotionReports(outlets, control, autopilot)
        self.orders = MotionOrders(outlets, autopilot, control, stop, reports, next_request_id)
        self.neighbours = NeighbourReports(outlets, autopilot, own_place)

    def autopilot_found(self) -> None:
        """Reset all state, because another autopilot may have connected."""
        now_s = monotonic_s()
        self.control.observe([AutopilotStarted(now_s)], now_s)
        self.control.use(None)
        self._autopilot.reset()
        self._fence.autopilot_found()

    def vehicle(
        self, message: Message, age_s: float = 0.0, late_s: float | None = None
    ) -> None:
        """Handle a message from the autopilot.

        `age_s` is the time since its arrival [s], `late_s` its delay on the link [s].
        """
        now_s, before = monotonic_s(), self._autopilot.kind
        self.control.wake(now_s)
        self._autopilot.receive(message, now_s - age_s)
        if self._autopilot.kind != before:
            self.control.use(self._autopilot.kind)
        if isinstance(message, dialect.Heartbeat):
            self.control.watch(now_s)
        if self.control.authority is not None:
            self.control.observe(observations(message, now_s - age_s, late_s), now_s)
            self._fence.vehicle(message, now_s)

    def handle_request(self, request: VehicleRequest) -> None:
        """Handle a request of the guide: a motion, a sign of life, or an order's end."""
        now_s, authority = monotonic_s(), self.control.authority
        self.control.wake(now_s)
        if authority is None:
            return
        if request.order_id is None:
            if request.ends:
                self.control.end("the guide process has restarted", now_s)
                self._fence.repeat()
        elif request.order_id == authority.order_id:
            authority.planner_alive(now_s)
            if self._take_back.under_way:
                return
            if self.control.fly(request, now_s):
                self._reports.report(now_s)
            self.control.watch(now_s)

    def tick(self, silent_s: Mapping[Requester, float]) -> None:
        """Check the conditions of control, and send requests and reports that are due."""
        now_s = monotonic_s()
        self.control.wake(now_s, turn=True)
        self._reports.stations_silent(silent_s)
        self.control.tick(now_s)
        self._take_back.go_on(now_s)
        self.control.watch(now_s)
        self._autopilot.ask_identity(self._out.command, self._own_place()[0], now_s)
        if self.control.authority is not None:
            self._fence.tick(now_s, resting=self.control.standing is ControlStage.OUT)
        self._reports.tick(now_s)

    def counters(self) -> dict[str, float]:
        """Counts of refused orders and of commands, for the health report."""
        authority = self.control.authority
        counts = {} if authority is None else authority.counters
        return {
            "motion_orders_refused": self.orders.refused,
            "neighbours_refused": self.neighbours.refused,
            **self._fence.counters(),
            **{f"motion_{name}": float(count) for name, count in counts.items()},
        }
