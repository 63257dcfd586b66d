"""Reports about the motion order and the vehicle, for ground stations, operator and guide."""

from collections.abc import Mapping
from math import inf

from uavrt.core.log import get_logger
from uavrt.core.messages import StatusText, VehicleReport
from uavrt.drone.processes.motions.motion_control import MotionControl, MotionOutputs, Requester
from uavrt.drone.processes.motions.reported_autopilot import ReportedAutopilot
from uavrt.guidance.control.authority import Authority, ControlStage
from uavrt.link.tunnel.own_messages.motion_messages import MotionState, StateKind, encode_state

log = get_logger()

REPORT_S = 0.1
STATE_S = 1.0
NEVER_S = 1e6
UNKNOWN = "the autopilot's type is unknown. Use a multirotor with PX4 or ArduPilot"


class MotionReports:
    """Sends answers to motion requests, and reports about the order in progress."""

    def __init__(
        self, outlets: MotionOutputs, control: MotionControl, autopilot: ReportedAutopilot
    ) -> None:
        self._out, self._control, self._autopilot = outlets, control, autopilot
        self._silent_s: Mapping[Requester, float] = {}
        self._confirmer: Requester | None = None
        """Station that confirmed the order; control ends when this station falls silent."""
        self._request: tuple[Requester, int] | None = None
        self._answered: bytes | None = None
        """Encoded answer to the last motion request; None if not answered yet."""
        self._next_report_s = self._next_state_s = -inf

    def answer(
        self,
        kind: StateKind,
        text: str,
        requester: Requester | None,
        request_id: int,
        *,
        order_id: int = 0,
        nonce: int = 0,
    ) -> None:
        """Send an answer to the station `requester`, or to all stations if it is None."""
        authority = self._control.authority
        state = MotionState(
            kind=kind,
            standing="out" if authority is None else authority.standing.value,
            text=text,
            request_id=request_id,
            order_id=self._control.order_id if kind == "state" else order_id,
            nonce=nonce,
        )
        payload = encode_state(state)
        if requester is not None and (requester, request_id) == self._request:
            self._answered = payload
        self._out.state(payload, requester)

    def is_repeated(self, requester: Requester, request_id: int) -> bool:
        """True if a request repeats the previous one, whose answer is then sent again."""
        if (requester, request_id) != self._request:
            self._request, self._answered = (requester, request_id), None
            return False
        if self._answered is not None:
            self._out.state(self._answered, requester)
        return True

    def confirmed(self, requester: Requester, request_id: int, now_s: float) -> None:
        """Report that the station `requester` has confirmed the order."""
        self._confirmer = requester
        self.answer("state", "confirmed", requester, request_id)
        self.report(now_s)

    def standing_changed(self, now_s: float) -> None:
        """Report a new stage of control to operator, stations and guide."""
        control = self._control
        ended = control.authority if control.standing is ControlStage.OUT else None
        log.info(
            "state of motion control changed",
            standing=control.standing.value,
            reason=control.text,
            nearest_m=None if ended is None else ended.nearest_m,
        )
        if control.standing is ControlStage.OUT:
            self._out.text(StatusText(severity=5, text=f"Not flying: {control.text}"))
        self._report_state(now_s)
        self.report(now_s)

    def tick(self, now_s: float) -> None:
        """Send the reports that are due."""
        if now_s >= self._next_report_s:
            self.report(now_s)
        if now_s >= self._next_state_s:
            self._report_state(now_s)

    def _report_state(self, now_s: float) -> None:
        self._next_state_s = now_s + STATE_S
        self.answer("state", self._control.text, None, 0)

    def stations_silent(self, silent_s: Mapping[Requester, float]) -> None:
        """Set the time since each ground station's last message [s]."""
        self._silent_s = silent_s

    @property
    def _ground_silent_s(self) -> float:
        """Silence of the station that confirmed the order, else the shortest of all [s]."""
        silent_s = self._silent_s
        if self._control.standing is ControlStage.OUT or self._confirmer is None:
            return min((NEVER_S, *silent_s.values()))
        return min(NEVER_S, silent_s.get(self._confirmer, NEVER_S))

    def report(self, now_s: float) -> None:
        """Send the state of vehicle and order to the guide process."""
        self._next_report_s = now_s + REPORT_S
        self._out.record("vehicle", self._vehicle_report(now_s))

    def _vehicle_report(self, now_s: float) -> VehicleReport:
        authority = self._control.authority
        if authority is None:
            return VehicleReport(autopilot=None, fault=UNKNOWN, takeoff_fault=UNKNOWN)
        return VehicleReport(
            autopilot=self._autopilot.kind,
            fault=self._fault(authority, now_s),
            takeoff_fault=self._fault(authority, now_s, takeoff=True),
            standing=authority.standing.value,
            reason=authority.reason,
            order_id=authority.order_id,
            mode=authority.vehicle.mode_name,
            seen=authority.vehicle_seen(
                battery_percent=self._autopilot.battery_percent(now_s),
                requests_sent=self._control.sent,
                requests_refused=self._control.refused,
                ground_silent_s=self._ground_silent_s,
            ),
            wind_m_s=self._autopilot.wind_m_s(now_s),
        )

    def _fault(
        self, authority: Authority, now_s: float, *, takeoff: bool = False
    ) -> str | None:
        fault = authority.fault(now_s, takeoff=takeoff)
        return self._autopilot.link_fault if fault is None else f"{fault[0]}. {fault[1]}"
