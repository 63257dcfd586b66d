"""Convert the connection process's vehicle report to the state that guidance uses; no I/O."""

from dataclasses import fields

from uavrt.core.messages import VehicleReport
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import VehicleNow
from uavrt.planning.drone_model.drone_motion import Wind


def now_of(report: VehicleReport, time_s: float) -> VehicleNow | None:
    """Return the vehicle's state from a report; None if position or home is missing."""
    seen, wind = report.seen, report.wind_m_s
    if seen is None:
        return None
    return VehicleNow(
        **{one.name: getattr(seen, one.name) for one in fields(seen)},
        time_s=time_s,
        order_id=report.order_id,
        began=report.standing == ControlStage.IN_COMMAND.value,
        wind=None if wind is None else Wind(east_m_s=wind[0], north_m_s=wind[1]),
    )
