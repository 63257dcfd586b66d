"""A simulated drone that obeys commands as PX4 1.17 or ArduCopter 4.7 would.

It accelerates, brakes and turns within limits of acceleration and jerk. Gusts move it, wind
slows it, and its battery drains. It accepts, refuses and ignores commands as real autopilots
were observed to do. PX4 takes any z as altitude above mean sea level. It answers UNSUPPORTED to
a DO_REPOSITION without a change of mode, although it carries the command out.
"""

import math

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavCmd, MavResult
from uavrt.simulation.scene import geometry
from uavrt.simulation.vehicle.airframe import HOLD_HEADING_M, Airframe, Flavour, Frame, Target
from uavrt.simulation.vehicle.heading import Heading

MODES: dict[Flavour, dict[str, int]] = {
    "px4": {
        "position": 3 << 16,
        "hold": 4 << 16 | 3 << 24,
        "return": 4 << 16 | 5 << 24,
        "land": 4 << 16 | 6 << 24,
        "takeoff": 4 << 16 | 2 << 24,
    },
    "ardupilot": {"position": 5, "hold": 4, "return": 6, "land": 9, "brake": 17},
}
"""Numbers of the flight modes by name. In the mode ``hold`` (AUTO.LOITER of PX4, GUIDED of
ArduCopter) the vehicle carries out DO_REPOSITION."""
HOME_CORRECTED_S, HOME_STEP_S = 120.0, 0.3
"""Time after a take-off in which PX4 1.17 corrects home's altitude, and its period [s]."""
HOME_DRIFT_M, HOME_NOISE_M, HOME_LEAST_M = 6.0, 1.5, 1.0
"""Total correction of home's altitude, spread of single ones, and the smallest one [m]."""
DO_PAUSE_CONTINUE = 193
"""Number of the command by which ground stations pause a flight; uavrt never sends it."""
FULL_SCALE_DEG = 1e7
SPOOL_S = 1.5
"""Time from the take-off command until the vehicle leaves the ground [s]."""
IDLE_S = 10.0
"""Time until an armed vehicle on the ground disarms [s] (COM_DISARM_PRFLT, DISARM_DELAY)."""
NOT_GIVEN = 2**31 - 1
"""Value INT32_MAX, which marks a latitude or longitude as not given, like NaN in a
COMMAND_LONG."""


class GroundContact:
    """Simulates take-off and landing, and the change of home's altitude after a take-off."""

    def __init__(self, flavour: Flavour, *, landed: bool) -> None:
        self._corrects_home = flavour == "px4"
        self.landed = landed
        self.idle_s = 0.0
        self.false_flight_s = (0.0, 0.0)
        """Times after arming between which a standing vehicle is reported in the air [s]; PX4
        1.17 (SIH) did so once in ten take-offs, for 1.0 s."""
        self.home_up_m = 0.0
        """Altitude of home above that of the tangent plane, after PX4's corrections [m]."""
        self._off_ground_s: float | None = None
        """Time of the take-off [s]; None on the ground."""

    @property
    def shown_landed(self) -> bool:
        """True if the autopilot reports that the vehicle is on the ground."""
        begin_s, end_s = self.false_flight_s
        return self.landed and not begin_s <= self.idle_s < end_s

    def wait(self) -> None:
        """Restart the time limit after which an armed vehicle on the ground disarms."""
        self.idle_s = 0.0

    def stand(self, step_s: float, now_s: float, *, taking_off: bool) -> bool:
        """Advance the time of an armed vehicle on the ground; False when it must disarm."""
        self.idle_s += step_s
        if taking_off:
            self.landed = self.idle_s < SPOOL_S
            self._off_ground_s = None if self.landed else now_s
        return taking_off or self.idle_s <= IDLE_S

    def correct_home(self, step_s: float, now_s: float) -> None:
        """Change home's altitude as PX4 1.17 does after a take-off; the drone stays there."""
        if self._off_ground_s is None or not self._corrects_home:
            return
        since_s = now_s - self._off_ground_s
        number = math.floor(since_s / HOME_STEP_S)
        due = number > math.floor((since_s - step_s) / HOME_STEP_S)
        if not due or since_s > HOME_CORRECTED_S:
            return
        # Any fixed numbers without a pattern do.
        noise = math.sin(12.9898 * number) * 43758.5453 % 1.0 - 0.5
        wanted = HOME_DRIFT_M * (1.0 - math.exp(-since_s / 40.0)) + 2.0 * HOME_NOISE_M * noise
        if abs(wanted - self.home_up_m) >= HOME_LEAST_M:
            self.home_up_m = wanted


class FlyingVehicle:
    """A simulated vehicle near home that accepts commands from any sender."""

    def __init__(
        self,
        flavour: Flavour,
        plane: geometry.TangentPlane,
        frame: Frame | None = None,
        *,
        north_m: float = 0.0,
        east_m: float = 0.0,
        height_m: float = 40.0,
        yaw_deg: float = 0.0,
        armed: bool = True,
    ) -> None:
        self.flavour, self.plane = flavour, plane
        self.body = Airframe(flavour, frame or Frame(), north_m, east_m, height_m)
        self.heading = Heading(flavour, yaw_deg)
        self.acceptance_m = HOLD_HEADING_M
        """Distance from the target in which the heading stays [m]; of PX4, NAV_ACC_RAD."""
        self.ground = GroundContact(flavour, landed=height_m <= 0.0)
        self.mode, self.armed = MODES[flavour]["position"], armed
        self.target: Target | None = None
        self.paused = False
        """True while paused by DO_PAUSE_CONTINUE, which ArduCopter does not report."""
        self.taking_off = False
        """True from a take-off to the next command; ArduPilot reports no target meanwhile."""
        self.takeoff_height_m = 2.5
        """Height of a take-off command without a height [m] (MIS_TAKEOFF_ALT)."""

    @property
    def commanded(self) -> bool:
        """True if the flight mode obeys motion commands: AUTO.LOITER (PX4) or GUIDED."""
        return self.mode == MODES[self.flavour]["hold"]

    def latitude_longitude(self) -> tuple[float, float]:
        """Latitude and longitude of the vehicle [°]."""
        return self.plane.to_geodetic(*self.body.place_m)

    def set_mode(self, mode: int) -> None:
        """Change the mode, as by a switch on the remote control."""
        if mode == self.mode:
            return
        self.mode, self.taking_off, self.paused = mode, False, False
        self.heading.turn_to(None)
        self.body.set_velocity(None)
        self.body.end_leg()
        names = MODES[self.flavour]
        if self.ground.landed:
            self.target = None
        elif mode == names["return"]:
            height = max(self.body.height_m, self.body.frame.return_height_m)
            self.target = Target(north_m=0.0, east_m=0.0, height_m=height)
        elif mode == names["land"]:
            self.target = Target(
                north_m=self.body.north_m, east_m=self.body.east_m, height_m=0.0
            )
        elif mode in (names["hold"], names.get("takeoff")):
            self.target = self.body.here
        else:
            self.target = None

    def command(self, message: dialect.CommandInt | dialect.CommandLong) -> int | None:
        """Handle a motion command and return the answer; None for other commands."""
        match message.command:
            case MavCmd.DO_REPOSITION:
                return self._reposition(message)
            case MavCmd.CONDITION_YAW:
                return self._turn(message)
            case MavCmd.NAV_RETURN_TO_LAUNCH:
                self.set_mode(MODES[self.flavour]["return"])
                return MavResult.ACCEPTED
            case MavCmd.DO_SET_MODE:
                return self._set_mode(message)
            case MavCmd.NAV_TAKEOFF:
                return self._take_off(message)
            case MavCmd.COMPONENT_ARM_DISARM:
                return self._arm(on=message.param1 == 1.0)
            case _ if message.command == DO_PAUSE_CONTINUE:
                return self._pause(on=message.param1 == 0.0)
        return None

    def _pause(self, *, on: bool) -> int:
        """Stop or continue without a change of mode, as only ArduCopter in GUIDED can."""
        if self.flavour == "px4":
            return MavResult.UNSUPPORTED
        if not self.commanded or self.ground.landed:
            return MavResult.FAILED
        self.paused = on
        return MavResult.ACCEPTED

    def set_velocity(self, north_m_s: float, east_m_s: float, up_m_s: float) -> None:
        """Handle a velocity in SET_POSITION_TARGET_LOCAL_NED, which only GUIDED accepts."""
        if self.flavour == "ardupilot" and self.commanded and not self.ground.landed:
            self.body.set_velocity((north_m_s, east_m_s, up_m_s))

    def _arm(self, *, on: bool) -> int:
        """Arm or disarm as a pilot would; ArduPilot refuses in modes that end on the ground."""
        names = MODES[self.flavour]
        ending = self.flavour == "ardupilot" and self.mode in (names["return"], names["land"])
        if not self.ground.landed or (on and ending):
            return MavResult.DENIED
        self.armed = on
        self.ground.wait()
        return MavResult.ACCEPTED

    def _take_off(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        """Handle a take-off command; PX4 accepts it when disarmed and climbs once it is armed.

        ArduCopter accepts it only when armed.
        """
        z = message.z if isinstance(message, dialect.CommandInt) else message.param7
        px4 = self.flavour == "px4"
        landed = self.ground.landed
        if not px4 and not (self.armed and landed and self.commanded and z > 0.0):
            return MavResult.FAILED
        if not landed:
            return MavResult.DENIED
        height = z - self.plane.altitude_amsl_m if px4 else z
        if not math.isfinite(height):
            height = self.body.height_m + self.takeoff_height_m
        if px4:
            self.set_mode(MODES["px4"]["takeoff"])
        north, east = self.body.place_m
        self.target = Target(north_m=north, east_m=east, height_m=height)
        self.taking_off = True
        self.body.end_leg()
        self.ground.wait()
        return MavResult.ACCEPTED

    def _set_mode(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        if self.flavour == "px4":
            mode = int(message.param2) << 16 | int(message.param3) << 24
        else:
            mode = int(message.param2)
        if mode not in MODES[self.flavour].values():
            return MavResult.DENIED
        self.set_mode(mode)
        return MavResult.ACCEPTED

    def _turn(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        if self.flavour == "px4":
            return MavResult.UNSUPPORTED
        if not self.commanded:
            return MavResult.FAILED
        if message.param4:
            by_deg = -message.param1 if message.param3 < 0.0 else message.param1
        else:
            by_deg = (message.param1 - self.heading.yaw_deg + 180.0) % 360.0 - 180.0
        self.heading.turn(by_deg, message.param2 or 20.0)
        return MavResult.ACCEPTED

    def _reposition(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        px4, whole = self.flavour == "px4", isinstance(message, dialect.CommandInt)
        if not px4 and not whole:
            return MavResult.UNSUPPORTED
        changes = bool(int(message.param2) & 1)
        if not changes and not self.commanded:
            return MavResult.UNSUPPORTED if px4 else MavResult.DENIED
        target = self._asked_place(message)
        if target is None:
            return MavResult.DENIED
        if math.hypot(target.north_m, target.east_m) > self.body.frame.fence_m:
            return MavResult.ACCEPTED if px4 else MavResult.FAILED
        self.taking_off = False
        if changes:
            self.set_mode(MODES[self.flavour]["hold"])
        self.target = target
        self.body.begin_leg(target)
        turns = px4 and math.isfinite(message.param4)
        self.heading.turn_to(math.degrees(message.param4) % 360.0 if turns else None)
        return MavResult.ACCEPTED if changes or not px4 else MavResult.UNSUPPORTED

    def _asked_place(self, message: dialect.CommandInt | dialect.CommandLong) -> Target | None:
        here = self.body.here
        if isinstance(message, dialect.CommandInt):
            nowhere = NOT_GIVEN in (message.x, message.y)
            latitude, longitude = message.x / FULL_SCALE_DEG, message.y / FULL_SCALE_DEG
            z, relative = message.z, message.frame in (3, 6)
        else:
            nowhere = not math.isfinite(message.param5 + message.param6)
            latitude, longitude = message.param5, message.param6
            z, relative = message.param7, False
        if nowhere and self.flavour == "ardupilot":
            return None
        height = here.height_m
        if math.isfinite(z):
            absolute = self.flavour == "px4" or not relative
            height = z - self.plane.altitude_amsl_m if absolute else z
        north, east = (
            (here.north_m, here.east_m) if nowhere else self.plane.to_local(latitude, longitude)
        )
        return Target(north_m=north, east_m=east, height_m=height)

    def advance(self, step_s: float) -> None:
        """Move the vehicle for one short time step."""
        body, ground = self.body, self.ground
        body.elapse(step_s, armed=self.armed)
        if not self.armed:
            return
        if ground.landed:
            self.armed = ground.stand(step_s, body.elapsed_s, taking_off=self.taking_off)
            return
        ground.correct_home(step_s, body.elapsed_s)
        target = None if self.paused else self.target
        body.move(target, step_s, paused=self.paused)
        self.heading.advance(self._bearing_deg(target or body.here), step_s)
        self._land()

    def _bearing_deg(self, target: Target) -> float | None:
        if not self.commanded:
            return None
        place = self.body.place_m
        north, east = target.north_m - place[0], target.east_m - place[1]
        if math.hypot(north, east) <= self.acceptance_m:
            return None
        return math.degrees(math.atan2(east, north)) % 360.0

    def _land(self) -> None:
        names, target, body = MODES[self.flavour], self.target, self.body
        if self.mode == names.get("takeoff") and target is not None:
            if body.height_m > target.height_m - 0.5:
                self.set_mode(names["hold"])
                self.target = target
            return
        if target is None or self.mode not in (names["return"], names["land"]):
            return
        if self.mode == names["return"] and target.height_m > 0.0:
            at_home = math.hypot(body.north_m, body.east_m) < 1.0
            if at_home and abs(body.height_m - target.height_m) < 1.0:
                self.target = Target(north_m=0.0, east_m=0.0, height_m=0.0)
        elif body.height_m < 0.1:
            self.armed, self.target = False, None
            self.ground.landed = True
