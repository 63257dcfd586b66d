"""Convert an order to steps, and check them before the drone moves; no I/O."""

import itertools
from dataclasses import dataclass, replace
from math import ceil, cos, hypot, pi, sin

import numpy as np

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import PlanError
from uavrt.core.messages import KeepOut
from uavrt.core.units import wrap_degrees_360
from uavrt.guidance.autopilot_behaviour import Behaviour
from uavrt.guidance.energy_learning import energy_of
from uavrt.guidance.height_frames import check_height
from uavrt.guidance.operator_orders import Limits, Order, Place, VehicleNow
from uavrt.guidance.safety import SAFETY
from uavrt.planning.area import Circle, Polygon, SearchArea, survey_lines
from uavrt.planning.drone_model.drone_motion import Multirotor, VehicleState, Wind, headwind
from uavrt.planning.drone_model.energy import Battery, EnergyModel


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanLimits:
    """Limits of the steps into which orders are converted."""

    circle_corners: int = 36
    """Number of corners of the polygon that approximates the circular fence."""
    fastest_turn_deg_s: float = 45.0
    """Fastest turn in place [°/s]; a faster one would miss pulses in some directions."""
    most_turns: int = 60
    """Largest number of turns in place in one order."""
    most_lines: int = 200
    """Largest number of parallel lines in one survey."""
    sure_climb_m_s: float = 1.5
    """Climb rate that every autopilot reaches; used to predict how long a climb takes [m/s]."""


_LIMITS = PlanLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Go:
    """Step of an order: fly to a position, and hover there for `stay_s`."""

    place: Place
    height_m: float
    """Height of the position above home [m]."""
    yaw_deg: float | None = None
    """Heading during this step [°]; None leaves it to the autopilot."""
    stay_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """Step of an order: turn in place, by a single command."""

    turn_deg: float
    rate_deg_s: float


@dataclass(frozen=True, slots=True)
class Home:
    """Step of an order: return home and land, in the autopilot's own return mode."""


@dataclass(frozen=True, slots=True)
class SetTakeoffMode:
    """Step of an order: change to the mode from which a take-off is commanded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Climb:
    """Step of an order: take off and climb vertically."""

    height_m: float
    """Height above home at which the climb ends [m]."""


Step = Go | Turn | Home | SetTakeoffMode | Climb


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Steps of an order, with duration and a description for the operator."""

    steps: tuple[Step, ...]
    summary: str
    duration_s: float


def plan_of(order: Order, now: VehicleNow, limits: Limits, behaviour: Behaviour) -> Plan:
    """Return the checked steps of an order; raises `PlanError` if it cannot be flown."""
    plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
    here = (now.latitude_deg, now.longitude_deg)
    check_keep_out(order, limits, plane, (here,))
    check_map(now, limits)
    if order.action == "return":
        return Plan(steps=(Home(),), summary="return home by the autopilot", duration_s=0.0)
    height = now.altitude_relative_m if order.height_m is None else order.height_m
    check_height(height, lowest_m=limits.lowest_m, highest_m=limits.highest_m)
    check_ground((here,), now, limits, height)
    if order.action in ("hold", "rotate"):
        _check_stay(now, limits, plane)
    match order.action:
        case "hold":
            return Plan(
                steps=(Go(place=here, height_m=height),),
                summary=f"hold here at {height:.0f} m",
                duration_s=0.0,
            )
        case "rotate":
            return rotation(order, now, limits, behaviour, height)
        case "goto":
            return _plan_path(_only_place(order), "fly to", order, now, limits, height)
        case "takeoff":
            return _takeoff(order, now, limits, behaviour, height)
        case "survey":
            return _survey(order, now, limits, behaviour, height)
        case _:
            raise PlanError(
                f"there is no motion command {order.action!r}", remedy="See `uavrt fly --help`"
            )


def _check_stay(now: VehicleNow, limits: Limits, plane: TangentPlane) -> None:
    """Raise `PlanError` if the drone is beyond the fence or must return for battery or wind."""
    (here,) = _local(plane, ((now.latitude_deg, now.longitude_deg),))
    if not _fence(limits).contains(*np.array([here]).T).all():
        raise PlanError(
            f"the drone is {hypot(*here):.0f} m from home, beyond the fence of "
            f"{limits.fence_m:.0f} m",
            remedy="Run `uavrt fly return`, or widen guidance.fence_m",
        )
    reason = must_return(now, limits)
    if reason is not None:
        raise PlanError(reason, remedy="Return: `uavrt fly return`")


def _takeoff(
    order: Order, now: VehicleNow, limits: Limits, behaviour: Behaviour, height: float
) -> Plan:
    if order.height_m is None:
        raise PlanError(
            "a take-off needs a height", remedy="Give one, for example: `uavrt fly takeoff 30`"
        )
    plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
    (here,) = _local(plane, ((now.latitude_deg, now.longitude_deg),))
    if not _fence(limits).contains(*np.array([here]).T).all():
        raise PlanError(
            f"the drone is beyond the fence, {limits.fence_m:.0f} m from home",
            remedy="Widen guidance.fence_m, or carry the drone closer",
        )
    duration = 5.0 + max(0.0, height - now.altitude_relative_m) / _LIMITS.sure_climb_m_s
    check_battery(now, limits, duration, here, height)
    first = (SetTakeoffMode(),) if behaviour.own_mode_first else ()
    return Plan(
        steps=(*first, Climb(height_m=height)),
        summary=f"take off, straight up to {height:.0f} m",
        duration_s=duration,
    )


def _only_place(order: Order) -> tuple[Place, ...]:
    if len(order.places) != 1:
        raise PlanError(
            f"goto takes one position, got {len(order.places)}",
            remedy="Give one latitude and longitude",
        )
    return order.places


def rotation(
    order: Order, now: VehicleNow, limits: Limits, behaviour: Behaviour, height: float
) -> Plan:
    """Plan a full turn here; raises `PlanError` for a bad duration or an unknown heading."""
    here = (now.latitude_deg, now.longitude_deg)
    steps, duration = _turn_steps(here, order, now, limits, behaviour, height)
    by_steps = behaviour.yaw_in_reposition
    how = f"{limits.headings} headings" if by_steps else f"{360.0 / order.duration_s:.0f}°/s"
    side = "to the right" if order.clockwise else "to the left"
    return Plan(
        steps=steps,
        summary=f"turn once {side} here at {height:.0f} m: {how}",
        duration_s=duration,
    )


def _turn_steps(
    place: Place,
    order: Order,
    now: VehicleNow,
    limits: Limits,
    behaviour: Behaviour,
    height: float,
) -> tuple[tuple[Step, ...], float]:
    """Return the steps of a full turn at a position, and their duration [s]."""
    least = 360.0 / _LIMITS.fastest_turn_deg_s
    if not least <= order.duration_s <= 600.0:
        raise PlanError(
            f"a full turn in {order.duration_s:g} s is not possible",
            remedy=f"Choose a duration of {least:.0f} to 600 s",
        )
    if now.yaw_deg is None:
        raise PlanError("the heading is unknown", remedy="Wait for the compass")
    way = 1.0 if order.clockwise else -1.0
    if not behaviour.yaw_in_reposition:
        turn = Turn(turn_deg=way * 360.0, rate_deg_s=360.0 / order.duration_s)
        return (Go(place=place, height_m=height), turn), order.duration_s
    looks = tuple(
        Go(
            place=place,
            height_m=height,
            yaw_deg=wrap_degrees_360(now.yaw_deg + way * 360.0 * n / limits.headings),
            stay_s=order.duration_s / limits.headings,
        )
        for n in range(limits.headings)
    )
    return looks, order.duration_s + 3.0 * limits.headings


def survey_places(order: Order, home: Place) -> tuple[Place, ...]:
    """Return a survey's positions in the order of flight; raises `PlanError` if invalid."""
    plane = TangentPlane(latitude_deg=home[0], longitude_deg=home[1])
    outline = Polygon(corners=_local(plane, order.places), name="area")
    if order.pattern == "around":
        return (*order.places, order.places[0])
    if not 5.0 <= order.spacing_m <= 1000.0:
        raise PlanError(
            f"the line spacing of {order.spacing_m:g} m is out of range",
            remedy="Give 5 to 1000 m",
        )
    lines = survey_lines(outline, order.spacing_m, most=_LIMITS.most_lines)
    if order.pattern == "points":
        lines = _points_on(lines, order.spacing_m)
    return tuple(_geodetic(plane, one) for one in lines)


def _points_on(lines: list[tuple[float, float]], spacing_m: float) -> list[tuple[float, float]]:
    """Positions for full turns, evenly along the lines; raises `PlanError` if there are too
    many.
    """
    ends = list(zip(lines[::2], lines[1::2], strict=True))
    counts = [max(1, round(hypot(x1 - x0, y1 - y0) / spacing_m)) for (x0, y0), (x1, y1) in ends]
    if sum(counts) > _LIMITS.most_turns:
        raise PlanError(
            f"the survey has {sum(counts)} positions for turns; at most {_LIMITS.most_turns} "
            "are allowed",
            remedy="Choose a wider spacing or a smaller area",
        )
    found = []
    for ((x0, y0), (x1, y1)), count in zip(ends, counts, strict=True):
        shares = [(number + 0.5) / count for number in range(count)]
        found += [(x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in shares]
    return found


def _survey(
    order: Order, now: VehicleNow, limits: Limits, behaviour: Behaviour, height: float
) -> Plan:
    places = survey_places(order, now.home)
    area_of(order, order.places, now, limits)
    words = {
        "lines": f"survey {len(places) // 2} lines",
        "around": "fly around the area",
        "points": f"turn at {len(places)} places",
    }[order.pattern]
    if order.pattern != "points":
        return _plan_path(places, f"{words}, from", order, now, limits, height)
    turns = [_turn_steps(place, order, now, limits, behaviour, height) for place in places]
    plan = _plan_path(places, f"{words}, from", order, now, limits, height, turn_s=turns[0][1])
    steps = tuple(
        step
        for place, (turn, _) in zip(places, turns, strict=True)
        for step in (Go(place=place, height_m=height), *turn)
    )
    return replace(plan, steps=steps)


def area_of(
    order: Order, places: tuple[Place, ...], now: VehicleNow, limits: Limits
) -> SearchArea:
    """Return the outlined area with all limits for flights in it.

    Raises `PlanError` if home is not in a permitted area.
    """
    plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
    area = SearchArea(
        search=Polygon(corners=_local(plane, places), name="area"),
        fence=_fence(limits),
        excluded=excluded_areas(order, limits, plane),
        within=_within(limits, plane),
        margin_m=SAFETY.margin_m,
        straight_home=True,
        lowest_m=limits.lowest_m,
        highest_m=limits.highest_m,
    )
    if limits.ground is not None:
        known, home = limits.ground.above_home_m, limits.ground.highest_home_m
        area = replace(area, ground=known, ground_home=home)
    area.check_home()
    return area


def check_keep_out(
    order: Order, limits: Limits, plane: TangentPlane, places: tuple[Place, ...]
) -> None:
    """Raise `PlanError` if path or return crosses an excluded area or leaves the geofence."""
    voids, within = excluded_areas(order, limits, plane), _within(limits, plane)
    if not (voids or within):
        return
    area = SearchArea(
        search=_fence(limits),
        excluded=voids,
        within=within,
        margin_m=SAFETY.margin_m,
        straight_home=True,
    )
    area.check_home()
    x, y = np.array(_local(plane, places)).T
    reason = area.entered_area(x[:1], y[:1])
    if reason is not None:
        raise PlanError(
            f"no path is possible from the drone's position: {reason}",
            remedy="Fly the drone away from there by hand",
        )
    reason = area.entered_area(x, y)
    if reason is not None:
        raise PlanError(reason, remedy="Fly around it in several orders, or take off elsewhere")


def check_map(now: VehicleNow, limits: Limits) -> None:
    """Raise `PlanError` if home's heights by map and autopilot differ by more than 15 m."""
    apart = map_fault(now, limits)
    if apart is not None:
        raise PlanError(apart, remedy="Check guidance.terrain, its datum, and home")


def map_fault(now: VehicleNow, limits: Limits) -> str | None:
    """Return a text if home's heights by map and autopilot differ too much; else None."""
    ground, home_amsl_m = limits.ground, now.altitude_amsl_m - now.altitude_relative_m
    apart = None if ground is None else ground.apart_m(home_amsl_m)
    return (
        None
        if apart is None
        else f"home's altitude differs by {apart:+.0f} m from the elevation map"
    )


def check_ground(
    stations: tuple[Place, ...], now: VehicleNow, limits: Limits, height: float
) -> None:
    """Raise `PlanError` if the path or the return from it is too low above ground.

    A climb may begin late and a descent early. So the first part of the path counts with the
    lower of its two heights.
    """
    ground = limits.ground
    if ground is None:
        return
    plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
    local = np.array(_local(plane, stations))
    first = min(height, now.altitude_relative_m) if len(stations) > 1 else height
    for number, (a, b) in enumerate(itertools.pairwise([*local, local[-1]])):
        share = np.linspace(0.0, 1.0, int(np.hypot(*(b - a)) / ground.step_m) + 2)
        x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
        beneath = ground.above_home_m(x, y)
        flown = first if number == 0 else height
        if np.isnan(beneath).any() and height < now.altitude_relative_m - SAFETY.gust_below_m:
            raise PlanError(
                "the path descends where the elevation map has no data",
                remedy="Keep the height, or add the tile to guidance.terrain",
            )
        high = float(np.nanmax(np.append(beneath, 0.0)))
        needed = max(high, float(ground.highest_home_m(x, y).max())) + limits.lowest_m
        if flown < needed - SAFETY.gust_below_m:
            raise PlanError(
                f"path and return need {needed:.0f} m above home to clear the ground",
                remedy=f"Climb first: `uavrt fly hold --height {ceil(needed)}`",
            )
        low = float(np.nanmin(np.append(beneath, np.inf)))
        if np.isfinite(low) and height - low > limits.highest_m + SAFETY.gust_below_m:
            raise PlanError(
                f"{height:.0f} m above home is {height - low:.0f} m above ground on the "
                "path, which is too high",
                remedy="Choose a smaller height",
            )


def excluded_areas(
    order: Order, limits: Limits, plane: TangentPlane
) -> tuple[Circle | Polygon, ...]:
    """Return the excluded areas of order and limits as shapes in the local plane."""
    return tuple(_excluded(one, plane) for one in (*limits.keep_out, *order.keep_out))


def _within(limits: Limits, plane: TangentPlane) -> tuple[Circle | Polygon, ...]:
    """Return the areas in which the drone must stay as shapes in the local plane [m]."""
    return tuple(_excluded(one, plane) for one in limits.stay_in)


def _excluded(one: KeepOut, plane: TangentPlane) -> Circle | Polygon:
    corners = _local(plane, one.places)
    if one.radius_m is None:
        return Polygon(corners=corners, name=one.name or "polygon")
    ((east, north),) = corners
    return Circle(east_m=east, north_m=north, radius_m=one.radius_m, name=one.name)


def _fence(limits: Limits) -> Polygon:
    angles = [2.0 * pi * n / _LIMITS.circle_corners for n in range(_LIMITS.circle_corners)]
    corners = tuple((limits.fence_m * sin(a), limits.fence_m * cos(a)) for a in angles)
    return Polygon(corners=corners, name="fence")


def _local(plane: TangentPlane, places: tuple[Place, ...]) -> tuple[tuple[float, float], ...]:
    for latitude, longitude in places:
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            raise PlanError(
                f"{latitude:g}, {longitude:g} is not a position",
                remedy="Use degrees, such as 47 8.5",
            )
    if not places:
        raise PlanError("the area has no corners", remedy="Draw three or more corners")
    east, north = plane.to_local(*np.array(places).T)
    return tuple((float(x), float(y)) for x, y in zip(east, north, strict=True))


def _geodetic(plane: TangentPlane, local_m: tuple[float, float]) -> Place:
    latitude, longitude = plane.to_geodetic(*local_m)
    return float(latitude), float(longitude)


def _plan_path(
    places: tuple[Place, ...],
    words: str,
    order: Order,
    now: VehicleNow,
    limits: Limits,
    height: float,
    *,
    turn_s: float = 0.0,
) -> Plan:
    """Plan a path; raises `PlanError` if fence, ground or battery forbid it or the return."""
    if now.altitude_relative_m < limits.lowest_m - SAFETY.gust_below_m:
        raise PlanError(
            f"the drone is at {now.altitude_relative_m:.0f} m, below the least permitted "
            f"{limits.lowest_m:.0f} m",
            remedy=f"Climb first: `uavrt fly hold --height {ceil(limits.lowest_m)}`",
        )
    plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
    stations = ((now.latitude_deg, now.longitude_deg), *places)
    local = _local(plane, stations)
    x, y = np.array(local).T
    fence = _fence(limits)
    area = SearchArea(
        search=fence, lowest_m=limits.lowest_m, highest_m=limits.highest_m, fence=None
    )
    if not fence.contains(x, y).all():
        farthest = float(np.hypot(x, y).max())
        raise PlanError(
            f"the route leads {farthest:.0f} m from home, beyond the fence",
            remedy=f"Stay within {limits.fence_m:.0f} m, or widen guidance.fence_m",
        )
    reason = area.refusal(np.append(x, 0.0), np.append(y, 0.0), height)
    if reason is not None:
        raise PlanError(reason, remedy="Choose another height or position")
    check_keep_out(order, limits, plane, stations)
    check_ground(stations, now, limits, height)
    length = float(np.hypot(np.diff(x), np.diff(y)).sum())
    duration = length / limits.speed_m_s + (3.0 + turn_s) * len(places)
    check_battery(now, limits, duration, local[-1], height)
    end = f"{places[0][0]:.6f}, {places[0][1]:.6f}"
    return Plan(
        steps=tuple(Go(place=one, height_m=height) for one in places),
        summary=f"{words} {end} at {height:.0f} m: {length:.0f} m in {duration:.0f} s",
        duration_s=duration,
    )


def check_battery(
    now: VehicleNow,
    limits: Limits,
    duration_s: float,
    end_m: tuple[float, float],
    height: float,
) -> None:
    """Raise `PlanError` if charge or capacity is unknown or too low, or wind is too strong."""
    if limits.battery_wh is None:
        raise PlanError(
            "the battery capacity is unknown",
            remedy="Set guidance.battery_wh to its watt-hours",
        )
    if now.battery_percent is None:
        raise PlanError(
            "the autopilot does not report the remaining charge",
            remedy="Set up its battery monitor",
        )
    windy = too_windy(now, limits)
    if windy is not None:
        raise PlanError(windy, remedy="Wait for less wind, or check guidance.airspeed_m_s")
    climb = max(0.0, height - now.altitude_relative_m)
    energy, air = _energy(now, limits), now.wind or Wind()
    used = energy.used_wh(duration_s, limits.speed_m_s + air.speed_m_s, climb)
    needed = used + way_home_wh(end_m, height, now, limits) + reserve_wh(limits)
    left = limits.battery_wh * now.battery_percent / 100.0
    if left < needed:
        raise PlanError(
            f"route, return and reserve need {needed:.0f} Wh; the battery has {left:.0f} Wh",
            remedy="Fly less far, or change the battery",
        )


def reserve_wh(limits: Limits) -> float:
    """Energy that must remain in the battery after the return [Wh]."""
    return (limits.battery_wh or 0.0) * limits.reserve_percent / 100.0


def multirotor_of(limits: Limits) -> Multirotor:
    """Return a model of the drone's motion with the ground speed and airspeed of `limits`."""
    return Multirotor(
        speed_m_s=limits.speed_m_s, airspeed_m_s=limits.airspeed_m_s, acceleration_m_s2=3.0
    )


def _energy(now: VehicleNow, limits: Limits) -> EnergyModel:
    return energy_of(limits.hover_w) if now.energy is None else now.energy


def way_home_wh(
    place_m: tuple[float, float], height_m: float, now: VehicleNow, limits: Limits
) -> float:
    """Return the energy needed to return from a position [Wh].

    The wind is that reported or, if unknown, the strongest headwind of the settings.
    """
    state = VehicleState(time_s=0.0, east_m=place_m[0], north_m=place_m[1], height_m=height_m)
    home_m = (0.0, 0.0)
    air = headwind(state, home_m, limits.wind_m_s) if now.wind is None else now.wind
    return _energy(now, limits).way_home_wh(
        multirotor_of(limits), state, home_m, air, return_height_m=limits.return_height_m
    )


def too_windy(now: VehicleNow, limits: Limits) -> str | None:
    """Return a text if the reported wind is close to the drone's airspeed; else None."""
    if now.wind is None or now.wind.speed_m_s <= SAFETY.calm_share * limits.airspeed_m_s:
        return None
    return (
        f"wind of {now.wind.speed_m_s:.0f} m/s, close to the drone's "
        f"airspeed of {limits.airspeed_m_s:.0f} m/s"
    )


def must_return(now: VehicleNow, limits: Limits) -> str | None:
    """Return why any order must end in a return now: wind or battery.

    None if there is no reason.
    """
    windy = too_windy(now, limits)
    if windy is not None:
        return windy
    if limits.battery_wh is None or now.battery_percent is None:
        return None
    plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
    (place,) = _local(plane, ((now.latitude_deg, now.longitude_deg),))
    needed = way_home_wh(place, now.altitude_relative_m, now, limits)
    left = limits.battery_wh * now.battery_percent / 100.0
    battery = Battery(remaining_wh=left, reserve_wh=reserve_wh(limits))
    if not battery.must_return(needed):
        return None
    return f"{left:.0f} Wh left; the return takes {needed:.0f} Wh"
