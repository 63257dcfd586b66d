"""The vehicle's state as it travels between processes. Pure."""

from dataclasses import replace

from uavrt.guidance.authority import Standing
from uavrt.guidance.orders import VehicleNow
from uavrt.guidance.wishes import FlyThere, GoHome, TakeMode, TakeOff, TurnInPlace, Wish
from uavrt.messages import VehicleReport, VehicleWish
from uavrt.planning import Wind


def with_place(report: VehicleReport, now: VehicleNow) -> VehicleReport:
    """Add what a pilot is to know."""
    return replace(
        report,
        latitude_deg=now.latitude_deg,
        longitude_deg=now.longitude_deg,
        altitude_amsl_m=now.altitude_amsl_m,
        altitude_relative_m=now.altitude_relative_m,
        speed_m_s=now.speed_m_s,
        yaw_deg=now.yaw_deg,
        home=now.home,
        battery_percent=now.battery_percent,
        obeyed=now.obeyed,
        wishes_sent=now.wishes_sent,
        wishes_refused=now.wishes_refused,
        turned_deg=now.turned_deg,
        ground_silent_s=now.ground_silent_s,
    )


def now_of(report: VehicleReport, time_s: float) -> VehicleNow | None:
    """What a pilot is to know; None where position or home are not known."""
    latitude, longitude = report.latitude_deg, report.longitude_deg
    amsl, relative = report.altitude_amsl_m, report.altitude_relative_m
    if latitude is None or longitude is None or amsl is None or relative is None:
        return None
    if report.home is None:
        return None
    return VehicleNow(
        time_s=time_s,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=amsl,
        altitude_relative_m=relative,
        speed_m_s=report.speed_m_s,
        yaw_deg=report.yaw_deg,
        home=report.home,
        battery_percent=report.battery_percent,
        order_id=report.order_id,
        began=report.standing == Standing.IN_COMMAND.value,
        obeyed=report.obeyed,
        wishes_sent=report.wishes_sent,
        wishes_refused=report.wishes_refused,
        turned_deg=report.turned_deg,
        ground_silent_s=report.ground_silent_s,
        wind=None
        if report.wind_m_s is None
        else Wind(east_m_s=report.wind_m_s[0], north_m_s=report.wind_m_s[1]),
    )


def wish_record(order_id: int, wish: Wish, said: str) -> VehicleWish:
    """Write a wish."""
    match wish:
        case FlyThere():
            return VehicleWish(
                order_id=order_id,
                kind="fly",
                said=said,
                latitude_deg=wish.latitude_deg,
                longitude_deg=wish.longitude_deg,
                altitude_amsl_m=wish.altitude_amsl_m,
                yaw_deg=wish.yaw_deg,
            )
        case TurnInPlace():
            return VehicleWish(
                order_id=order_id,
                kind="turn",
                said=said,
                turn_deg=wish.turn_deg,
                rate_deg_s=wish.rate_deg_s,
            )
        case GoHome():
            return VehicleWish(order_id=order_id, kind="home", said=said)
        case TakeMode():
            return VehicleWish(order_id=order_id, kind="mode", said=said)
        case TakeOff():
            return VehicleWish(
                order_id=order_id,
                kind="takeoff",
                said=said,
                height_m=wish.height_m,
                altitude_amsl_m=wish.altitude_amsl_m,
            )


def wish_of(record: VehicleWish) -> Wish:
    """Read a wish of kind fly, turn, home, mode or takeoff."""
    if record.kind == "fly":
        return FlyThere(
            latitude_deg=record.latitude_deg,
            longitude_deg=record.longitude_deg,
            altitude_amsl_m=record.altitude_amsl_m,
            yaw_deg=record.yaw_deg,
        )
    if record.kind == "turn":
        return TurnInPlace(turn_deg=record.turn_deg, rate_deg_s=record.rate_deg_s)
    if record.kind == "mode":
        return TakeMode()
    if record.kind == "takeoff":
        return TakeOff(height_m=record.height_m, altitude_amsl_m=record.altitude_amsl_m)
    return GoHome()
