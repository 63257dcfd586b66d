"""Kinds of takeover by pilots, ground stations and failsafes, and the messages that reveal
each.
"""

import math
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.control.observed import FailsafeReport
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import observations
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import DO_PAUSE_CONTINUE, FULL_SCALE_DEG, MODES
from uavrt_experiments.autopilots.hand import CENTRED_US, FORCED, Hand
from uavrt_experiments.autopilots.measures import commands_of
from uavrt_experiments.autopilots.scene import RunningScene as Scene

BOTH: tuple[Flavour, ...] = ("px4", "ardupilot")
Shows = Callable[[Message], bool]
CUT_S = 7.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Takeover:
    """One kind of takeover, and the message that reveals it."""

    name: str
    act: Callable[[Scene], None]
    shows: Callable[[Hand], Shows] | None = None
    """Makes, before the takeover, a test that recognises the revealing message; None: no
    message reveals it, and uavrt must notice by itself."""
    flavours: tuple[Flavour, ...] = BOTH
    stops: bool = False
    """True if only the drone's stop reveals it; the order must end within 4 s of the stop."""
    undo: Callable[[Scene], None] = lambda _: None
    restarts: bool = False
    """True if the autopilot is restarted afterwards."""
    real_only: bool = False
    """True if uavrt's simulated autopilot does not support its message or parameter."""
    sticks: bool = False
    """True if a remote control is switched on before."""


def _mode(name: str) -> Callable[[Scene], None]:
    return lambda scene: scene.hand.name_mode(name)


def _other_mode(hand: Hand) -> Shows:
    own = MODES[hand.flavour]["hold"]

    def shows(message: Message) -> bool:
        reported = isinstance(message, dialect.CurrentMode) or (
            isinstance(message, dialect.Heartbeat)
            and message.autopilot != dialect.MavAutopilot.INVALID
        )
        return reported and message.custom_mode != own  # type: ignore[attr-defined]

    return shows


def _failing(hand: Hand) -> Shows:
    """True if a heartbeat shows a failsafe, which precedes the change of mode."""
    other_mode = _other_mode(hand)

    def shows(message: Message) -> bool:
        failing = any(isinstance(one, FailsafeReport) for one in observations(message, 0.0))
        return failing or other_mode(message)

    return shows


def _goal(hand: Hand) -> tuple[int, int, float]:
    """Present target of the drone; its present position if there is no target."""
    target, position = hand.target, hand.position
    if target is not None:
        return target.lat_int, target.lon_int, target.alt
    assert position is not None
    return position.lat, position.lon, position.alt / 1e3


def _other_target(hand: Hand) -> Shows:
    latitude, longitude, altitude_m = _goal(hand)

    def shows(message: Message) -> bool:
        if not isinstance(message, dialect.PositionTargetGlobalInt):
            return False
        off = max(abs(message.lat_int - latitude), abs(message.lon_int - longitude))
        return off > 5 or abs(message.alt - altitude_m) > 0.05

    return shows


def _other_heading(hand: Hand) -> Shows:
    assert hand.target is not None
    before_rad = hand.target.yaw
    return lambda m: (
        isinstance(m, dialect.PositionTargetGlobalInt)
        and abs(wrap_degrees_180(math.degrees(m.yaw - before_rad))) > 2.0
    )


def _other_sticks(_: Hand) -> Shows:
    def shows(message: Message) -> bool:
        if not isinstance(message, dialect.RcChannels):
            return False
        sticks = [getattr(message, f"chan{n}_raw") for n in range(1, 5)]
        return any(abs(a - b) > 60 for a, b in zip(sticks, CENTRED_US, strict=True))

    return shows


def _disarmed(_: Hand) -> Shows:
    armed = dialect.MavModeFlag.SAFETY_ARMED
    return lambda m: (
        isinstance(m, dialect.Heartbeat)
        and (m.autopilot != dialect.MavAutopilot.INVALID and not m.base_mode & armed)
    )


def _go(scene: Scene, away_m: float) -> None:
    way = scene.rng.uniform(0.0, math.tau)
    scene.hand.go_to(away_m * math.cos(way), away_m * math.sin(way))


def _go_nearby(scene: Scene) -> None:
    """Send the drone to a place one metre from its target."""
    latitude, longitude, altitude_m = _goal(scene.hand)
    scene.hand.reposition(latitude + 90, longitude, altitude_m)


def _go_higher(scene: Scene) -> None:
    latitude, longitude, altitude_m = _goal(scene.hand)
    scene.hand.reposition(latitude, longitude, altitude_m + 8.0)


def _turn(scene: Scene) -> None:
    """Turn the drone at its target by 12° from the heading that uavrt commanded.

    If uavrt commanded no heading, the turn starts from the bearing of the target.
    """
    _, last = commands_of(scene.companion.kept)[-1]
    latitude, longitude, altitude_m = _goal(scene.hand)
    yaw_rad = last.param4
    if not math.isfinite(yaw_rad):
        here_lat, here_lon = scene.hand.place
        plane = TangentPlane(latitude_deg=here_lat, longitude_deg=here_lon)
        east_m, north_m = plane.to_local(latitude / FULL_SCALE_DEG, longitude / FULL_SCALE_DEG)
        yaw_rad = math.atan2(float(east_m), float(north_m))
    yaw_rad = (yaw_rad + math.radians(12.0)) % math.tau
    scene.hand.reposition(latitude, longitude, altitude_m, yaw_rad=yaw_rad)


def _condition_yaw(scene: Scene) -> None:
    scene.hand.command(dialect.MavCmd.CONDITION_YAW, 90.0, 40.0, 1.0, 1.0)


def _pause(scene: Scene) -> None:
    if scene.hand.flavour == "px4":
        scene.hand.reposition()
    else:
        scene.hand.name_mode("brake")


def _stick(scene: Scene) -> None:
    channels = list(CENTRED_US)
    channels[scene.rng.randrange(2)] = 1700
    scene.hand.channels_us = tuple(channels)


def _centred(scene: Scene) -> None:
    scene.hand.channels_us = CENTRED_US


def _kill(process: str) -> Callable[[Scene], None]:
    return lambda scene: os.kill(scene.pid_of(process), signal.SIGKILL)


def _cut(scene: Scene) -> None:
    """Cut the companion link for long enough that the drone must notice."""
    scene.companion.cut = True
    time.sleep(CUT_S)
    scene.companion.cut = False


def _anything(_: Hand) -> Shows:
    return lambda _message: True


def _fence(scene: Scene, *, on: bool) -> None:
    hand = scene.hand
    if hand.flavour == "px4":
        hand.set_parameter("GF_ACTION", 3, whole=True)
        hand.set_parameter("GF_MAX_HOR_DIST", 5.0 if on else 0.0)
    else:
        hand.set_parameter("FENCE_RADIUS", 5.0 if on else 900.0)
        hand.set_parameter("FENCE_TYPE", 2)
        hand.set_parameter("FENCE_ENABLE", float(on))


def _battery(scene: Scene, *, empty: bool) -> None:
    """Make the autopilot detect a low battery.

    The reported charge is not changed, because uavrt itself returns early when it falls.
    """
    hand = scene.hand
    if hand.flavour == "px4":
        hand.set_parameter("BAT_CRIT_THR", 1.1 if empty else 0.07)
    else:
        hand.set_parameter("BATT_LOW_TIMER", 1.0)
        hand.set_parameter("BATT_LOW_VOLT", 10.5)
        hand.set_parameter("BATT_FS_LOW_ACT", 2.0 if empty else 0.0)
        hand.set_parameter("SIM_BATT_VOLTAGE", 9.8 if empty else 12.6)


TAKEOVERS: tuple[Takeover, ...] = (
    Takeover(name="mode: return", act=_mode("return"), shows=_other_mode),
    Takeover(name="mode: land", act=_mode("land"), shows=_other_mode),
    Takeover(
        name="mode: loiter",
        act=_mode("position"),
        shows=_other_mode,
        flavours=("ardupilot",),
        sticks=True,
    ),
    Takeover(
        name="pause",
        act=_pause,
        shows=lambda hand: (_other_target if hand.flavour == "px4" else _other_mode)(hand),
    ),
    Takeover(
        name="pause by 193",
        act=lambda scene: scene.hand.command(DO_PAUSE_CONTINUE, 0.0),
        undo=lambda scene: scene.hand.command(DO_PAUSE_CONTINUE, 1.0),
        flavours=("ardupilot",),
        stops=True,
    ),
    Takeover(name="go elsewhere", act=lambda s: _go(s, 80.0), shows=_other_target),
    Takeover(name="go nearby", act=_go_nearby, shows=_other_target),
    Takeover(name="go higher", act=_go_higher, shows=_other_target),
    Takeover(name="turn at our target", act=_turn, shows=_other_heading, flavours=("px4",)),
    Takeover(name="turn by 115", act=_condition_yaw, flavours=("ardupilot",)),
    Takeover(
        name="velocity",
        act=lambda scene: scene.hand.set_velocity(1.5, 1.0),
        flavours=("ardupilot",),
        real_only=True,
    ),
    Takeover(
        name="stick",
        act=_stick,
        shows=_other_sticks,
        undo=_centred,
        sticks=True,
        flavours=("ardupilot",),
        real_only=True,
    ),
    Takeover(
        name="fence",
        act=lambda scene: _fence(scene, on=True),
        shows=_failing,
        undo=lambda scene: _fence(scene, on=False),
        real_only=True,
    ),
    Takeover(
        name="battery",
        act=lambda scene: _battery(scene, empty=True),
        shows=_failing,
        undo=lambda scene: _battery(scene, empty=False),
        restarts=True,
        real_only=True,
    ),
    Takeover(name="guide killed", act=_kill("guide")),
    Takeover(name="connection killed", act=_kill("connection")),
    Takeover(name="link cut", act=_cut, shows=_anything),
    Takeover(
        name="disarmed",
        act=lambda scene: scene.hand.command(400, 0.0, FORCED),
        shows=_disarmed,
        restarts=True,
    ),
)


def takeovers_of(flavour: Flavour) -> list[Takeover]:
    """All kinds of takeover that an autopilot supports."""
    return [one for one in TAKEOVERS if flavour in one.flavours]
