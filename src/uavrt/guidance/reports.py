"""The vehicle's state as it travels from the connection to the guide. Pure."""

from dataclasses import replace

from uavrt.guidance.authority import Standing
from uavrt.guidance.orders import VehicleNow
from uavrt.messages import VehicleReport
from uavrt.planning.vehicle import Wind

_SHARED = (
    *("latitude_deg", "longitude_deg", "altitude_amsl_m", "altitude_relative_m"),
    *("speed_m_s", "yaw_deg", "home", "battery_percent", "obeyed", "wishes_sent"),
    *("wishes_refused", "turned_deg", "ground_silent_s"),
)
"""Fields that both records have."""


def with_place(report: VehicleReport, now: VehicleNow) -> VehicleReport:
    """Add what a pilot needs to know."""
    return replace(report, **{name: getattr(now, name) for name in _SHARED})


def now_of(report: VehicleReport, time_s: float) -> VehicleNow | None:
    """What a pilot needs to know; None where position or home are not known."""
    if None in (report.latitude_deg, report.altitude_relative_m, report.home):
        return None
    wind = report.wind_m_s
    return VehicleNow(
        time_s=time_s,
        order_id=report.order_id,
        began=report.standing == Standing.IN_COMMAND.value,
        wind=None if wind is None else Wind(east_m_s=wind[0], north_m_s=wind[1]),
        **{name: getattr(report, name) for name in _SHARED},
    )
