"""Convert requested motions to the autopilot's commands; no I/O."""

from dataclasses import dataclass
from math import isfinite, nan, radians
from typing import Literal

from uavrt.core.errors import CommandRefused
from uavrt.core.messages import FlyThere, GoHome, Manoeuvre, TakeMode, TakeOff, TurnInPlace
from uavrt.core.units import wrap_degrees_360
from uavrt.guidance.autopilot_behaviour import Behaviour
from uavrt.guidance.control.observed import HomeReport, between_m


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleCommand:
    """A command for the autopilot; it is sent as COMMAND_INT."""

    name: Literal[
        "DO_REPOSITION", "CONDITION_YAW", "NAV_RETURN_TO_LAUNCH", "DO_SET_MODE", "NAV_TAKEOFF"
    ]
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    x: int = 0
    y: int = 0
    z_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandWriter:
    """Converts requested motions to commands for one kind of autopilot.

    Motions beyond the limits are refused.
    """

    behaviour: Behaviour
    lowest_m: float = 20.0
    highest_m: float = 120.0
    """Largest allowed height of a commanded target above home [m]."""
    farthest_m: float = 1000.0
    """Largest allowed distance of a commanded target from home [m]."""

    def command(
        self, manoeuvre: Manoeuvre, *, first: bool, datum_m: float, home: HomeReport | None
    ) -> VehicleCommand:
        """Return the command for a motion.

        `datum_m` is the altitude to which heights relate [m]. Raises `CommandRefused` beyond
        the limits.
        """
        match manoeuvre:
            case FlyThere():
                return self._fly_there(
                    manoeuvre, first, manoeuvre.altitude_amsl_m - datum_m, home
                )
            case TurnInPlace():
                if first or self.behaviour.yaw_in_reposition:
                    raise CommandRefused("this autopilot does not support this kind of turn")
                if not 0.0 < abs(manoeuvre.turn_deg) <= 360.0 or not manoeuvre.rate_deg_s > 0.0:
                    raise CommandRefused(
                        f"the drone cannot turn {manoeuvre.turn_deg:g}° at "
                        f"{manoeuvre.rate_deg_s:g}°/s"
                    )
                return VehicleCommand(
                    name="CONDITION_YAW",
                    param1=abs(manoeuvre.turn_deg),
                    param2=manoeuvre.rate_deg_s,
                    param3=1.0 if manoeuvre.turn_deg > 0.0 else -1.0,
                    param4=1.0,
                )
            case GoHome():
                return VehicleCommand(name="NAV_RETURN_TO_LAUNCH")
            case TakeMode():
                if not (first and self.behaviour.own_mode_first):
                    raise CommandRefused(
                        "this autopilot needs no mode change before a take-off"
                    )
                return VehicleCommand(
                    name="DO_SET_MODE", param1=1.0, param2=float(self.behaviour.own_mode)
                )
            case TakeOff():
                return self._take_off(manoeuvre, first, manoeuvre.altitude_amsl_m - datum_m)

    def _fly_there(
        self, manoeuvre: FlyThere, first: bool, above_m: float, home: HomeReport | None
    ) -> VehicleCommand:
        on_globe = abs(manoeuvre.latitude_deg) <= 90.0 and abs(manoeuvre.longitude_deg) <= 180.0
        if not (on_globe and isfinite(manoeuvre.altitude_amsl_m)):
            raise CommandRefused(
                f"latitude {manoeuvre.latitude_deg}°, longitude {manoeuvre.longitude_deg}°, "
                f"{manoeuvre.altitude_amsl_m} m is not a position on earth"
            )
        self._check_height(above_m)
        if home is None or self.farthest_m < between_m(manoeuvre, home):
            raise CommandRefused(
                f"the target is farther than {self.farthest_m:.0f} m from home"
            )
        yaw = nan
        if manoeuvre.yaw_deg is not None and self.behaviour.yaw_in_reposition:
            yaw = radians(wrap_degrees_360(manoeuvre.yaw_deg))
        return VehicleCommand(
            name="DO_REPOSITION",
            param1=-1.0,
            param2=1.0 if first else 0.0,
            param4=yaw,
            x=round(manoeuvre.latitude_deg * 1e7),
            y=round(manoeuvre.longitude_deg * 1e7),
            z_m=manoeuvre.altitude_amsl_m,
        )

    def _take_off(self, manoeuvre: TakeOff, first: bool, above_m: float) -> VehicleCommand:
        """Return the take-off command. PX4 needs an altitude, ArduPilot a height above home."""
        if first == self.behaviour.own_mode_first:
            raise CommandRefused("the autopilot is not in its take-off mode")
        self._check_height(above_m)
        if not abs(above_m - manoeuvre.height_m) <= 1.0:
            raise CommandRefused(
                f"the take-off command has two different heights: {above_m:.0f} m and "
                f"{manoeuvre.height_m:.0f} m"
            )
        if self.behaviour.own_mode_first:
            return VehicleCommand(name="NAV_TAKEOFF", z_m=manoeuvre.height_m)
        return VehicleCommand(
            name="NAV_TAKEOFF",
            param1=-1.0,
            param4=nan,
            param5=nan,
            param6=nan,
            z_m=manoeuvre.altitude_amsl_m,
        )

    def _check_height(self, above_m: float) -> None:
        if not self.lowest_m - 0.5 <= above_m <= self.highest_m + 0.5:
            raise CommandRefused(
                f"{above_m:.0f} m above home is not between {self.lowest_m:.0f} m and "
                f"{self.highest_m:.0f} m"
            )
