"""Flight characteristics of an autopilot, computed from the frames of a flight."""

import bisect
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from uavrt.core.units import wrap_degrees_180
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavCmd
from uavrt.link.mavlink.message import Message
from uavrt.simulation.scene.geometry import TangentPlane
from uavrt.simulation.vehicle.simulated_flying import DO_PAUSE_CONTINUE, FULL_SCALE_DEG
from uavrt_experiments.autopilots.tap import Kept

LONG_M = 8.0
"""Shortest leg for which overshoot and settling are measured [m]."""
ARRIVED_M, NEAR_M, SETTLED_M = 1.5, 3.0, 0.5
NEARER_M, HIGHER_M, TURNED_DEG = 0.5, 0.3, 3.0
"""Change of distance [m], height [m] and heading [deg] after which a command counts as begun,
as in `uavrt.guidance.control.step_progress`."""
HIGH_M, LOOKS_DEG = 2.0, 8.0
"""Least error in height [m] and heading [deg] at the command for that change to count."""
TURN_DEG = 60.0
"""Smallest turn for which a turning rate is measured [deg]."""
RATE_S = 0.3
"""Time over which a turning rate is averaged [s]."""
AFTER_S = 4.0
"""Shortest time after an arrival for measuring how it settles [s]."""


@dataclass(frozen=True, slots=True)
class Place:
    """Position of the drone, in metres from its first reported position."""

    time_s: float
    north_m: float
    east_m: float
    amsl_m: float
    yaw_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Flying:
    """Flight characteristics: each tuple has one figure for each leg that shows it."""

    begins_s: tuple[float, ...]
    """Time from a command until the drone comes nearer in place, height or heading [s]."""
    overshoot_m: tuple[float, ...]
    settling_s: tuple[float, ...]
    """Time from 3 m before the target until the drone stays within 0.5 m of it [s]."""
    turn_rate_deg_s: tuple[float, ...]
    height_error_m: tuple[float, ...]
    """Altitude at each arrival minus the commanded altitude [m]."""


Command = dialect.CommandInt | dialect.CommandLong


def is_motion(message: Message) -> bool:
    """True if a message commands a vehicle to move, turn or change its mode."""
    return isinstance(message, dialect.CommandInt | dialect.CommandLong) and (
        message.command
        in (
            MavCmd.DO_REPOSITION,
            MavCmd.CONDITION_YAW,
            MavCmd.NAV_RETURN_TO_LAUNCH,
            MavCmd.DO_SET_MODE,
            MavCmd.NAV_TAKEOFF,
            MavCmd.COMPONENT_ARM_DISARM,
            DO_PAUSE_CONTINUE,
        )
    )


def commands_of(kept: Iterable[Kept]) -> list[tuple[float, Command]]:
    """All motion commands sent by uavrt, with their times [s]."""
    return [
        (one.time_s, message)
        for one in kept
        if one.ours and isinstance(message := one.message, Command) and is_motion(message)
    ]


def flying_of(kept: Sequence[Kept], out_s: float = math.inf) -> Flying:
    """Measure each leg up to the next command, or to the end of the frames.

    `kept`: frames of the companion link, in their order.
    `out_s`: time of a takeover [s], after which uavrt no longer flies.
    """
    found: dict[str, list[float]] = {name: [] for name in Flying.__slots__}
    commands = [one for one in commands_of(kept) if one[0] < out_s]
    positions = [
        (one.time_s, message)
        for one in kept
        if not one.ours and isinstance(message := one.message, dialect.GlobalPositionInt)
    ]
    if not positions:
        return Flying(**dict.fromkeys(found, ()))
    first = positions[0][1]
    plane = TangentPlane(
        latitude_deg=first.lat / FULL_SCALE_DEG,
        longitude_deg=first.lon / FULL_SCALE_DEG,
        altitude_amsl_m=first.alt / 1e3,
    )

    def metres(latitude: int, longitude: int) -> tuple[float, float]:
        return plane.to_local(latitude / FULL_SCALE_DEG, longitude / FULL_SCALE_DEG)

    places = [
        Place(time_s, *metres(one.lat, one.lon), one.alt / 1e3, one.hdg / 100.0)
        for time_s, one in positions
        if time_s < out_s
    ]
    times = [one.time_s for one in places]
    for number, (sent_s, message) in enumerate(commands):
        if not isinstance(message, dialect.CommandInt):
            continue
        until_s = commands[number + 1][0] if number + 1 < len(commands) else out_s
        leg = places[bisect.bisect(times, sent_s) : bisect.bisect(times, until_s)]
        if len(leg) > 1:
            _measure(found, leg, sent_s, metres(message.x, message.y), message)
    return Flying(**{name: tuple(values) for name, values in found.items()})


def _measure(
    found: dict[str, list[float]],
    leg: Sequence[Place],
    sent_s: float,
    target: tuple[float, float],
    message: dialect.CommandInt,
) -> None:
    start = leg[0]
    north, east = target[0] - start.north_m, target[1] - start.east_m
    length = math.hypot(north, east)

    def left(one: Place) -> float:
        return math.hypot(target[0] - one.north_m, target[1] - one.east_m)

    def along(one: Place) -> float:
        return (
            (one.north_m - start.north_m) * north + (one.east_m - start.east_m) * east
        ) / length

    def bearing(one: Place) -> float:
        ahead, aside = target[0] - one.north_m, target[1] - one.east_m
        return one.yaw_deg if length < NEAR_M else math.degrees(math.atan2(aside, ahead))

    begun = _begins(leg, left, bearing, message)
    if begun is not None:
        found["begins_s"].append(begun - sent_s)
    swept, rate = _turning(leg)
    if swept >= TURN_DEG:
        found["turn_rate_deg_s"].append(rate)
    if length < LONG_M or min(map(left, leg)) > ARRIVED_M:
        return
    near_s = next(one.time_s for one in leg if left(one) <= NEAR_M)
    if leg[-1].time_s < near_s + AFTER_S:
        return
    found["overshoot_m"].append(max(0.0, max(map(along, leg)) - length))
    outside = [one.time_s for one in leg if left(one) > SETTLED_M]
    if outside[-1] < leg[-1].time_s:
        found["settling_s"].append(outside[-1] - near_s)
    found["height_error_m"].append(leg[-1].amsl_m - message.z)


def _begins(
    leg: Sequence[Place],
    left: Callable[[Place], float],
    bearing: Callable[[Place], float],
    message: dialect.CommandInt,
) -> float | None:
    """Time [s] of the first approach in place, height or heading; turning to the
    target counts.
    """

    def off_deg(one: Place) -> float:
        asked = math.isfinite(message.param4)
        wanted = math.degrees(message.param4) if asked else bearing(one)
        return abs(wrap_degrees_180(wanted - one.yaw_deg))

    start = leg[0]
    off_m, up_m, turn_deg = left(start), abs(start.amsl_m - message.z), off_deg(start)
    for one in leg:
        nearer = off_m > NEAR_M and off_m - left(one) >= NEARER_M
        higher = up_m > HIGH_M and up_m - abs(one.amsl_m - message.z) >= HIGHER_M
        turned = turn_deg > LOOKS_DEG and turn_deg - off_deg(one) >= TURNED_DEG
        if nearer or higher or turned:
            return one.time_s
    return None


def _turning(leg: Sequence[Place]) -> tuple[float, float]:
    """Range of the heading [deg] and its largest rate [deg/s]."""
    turned, total = [(leg[0].time_s, 0.0)], 0.0
    for before, one in pairwise(leg):
        total += wrap_degrees_180(one.yaw_deg - before.yaw_deg)
        turned.append((one.time_s, total))
    times = [time_s for time_s, _ in turned]
    rates = [0.0]
    for number, (time_s, angle) in enumerate(turned):
        then_s, then = turned[bisect.bisect_left(times, time_s - RATE_S, 0, number + 1)]
        if time_s - then_s > 0.5 * RATE_S:
            rates.append(abs(angle - then) / (time_s - then_s))
    angles = [angle for _, angle in turned]
    return max(angles) - min(angles), max(rates)


def heading_at(heading: Sequence[tuple[float, float]], time_s: float) -> float | None:
    """Interpolate the heading between two samples at most 0.2 s apart, or return None."""
    number = bisect.bisect(heading, (time_s, 0.0))
    if not 0 < number < len(heading):
        return None
    (t0, y0), (t1, y1) = heading[number - 1 : number + 1]
    if t1 - t0 > 0.2 or t1 <= t0:
        return None
    return y0 + wrap_degrees_180(y1 - y0) * (time_s - t0) / (t1 - t0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction:
    """uavrt's reaction to a takeover, from the frames of the companion link."""

    shown_s: float | None
    """Time from the takeover to the message that reveals it [s]; None: no message does."""
    last_command_s: float | None
    """Time from that message, or from the order's end, to the last command [s]; negative: the
    command came before it."""
    commands_after: int
    """Number of commands after that message, or after the order's end if that came first."""
    crossed: int
    """Number of commands between the takeover and that message, when uavrt could not detect
    it."""


def reaction(
    kept: Sequence[Kept],
    taken_s: float,
    out_s: float | None,
    shows: Callable[[Message], bool] | None,
) -> Reaction:
    """Evaluate uavrt's reaction to a takeover.

    `taken_s`: time of the pilot's action [s].
    `out_s`: time at which uavrt reported the end of the order [s].
    `shows`: recognises the message of the autopilot that reveals the takeover.
    """
    shown = next(
        (
            one.time_s
            for one in kept
            if shows is not None
            and one.time_s >= taken_s
            and not one.ours
            and (message := one.message) is not None
            and shows(message)
        ),
        math.inf,
    )
    since = min(shown, math.inf if out_s is None else out_s)
    times = [time_s for time_s, _ in commands_of(kept)]
    return Reaction(
        shown_s=shown - taken_s if math.isfinite(shown) else None,
        last_command_s=times[-1] - since if times and math.isfinite(since) else None,
        commands_after=sum(one > since for one in times),
        crossed=sum(taken_s <= one <= since for one in times),
    )
