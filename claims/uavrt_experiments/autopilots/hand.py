"""The pilot of a rehearsal: a ground station that arms, takes off and takes over.

Only the experiment uses it. It never runs on a drone, and uavrt never arms.
"""

import asyncio
import math
import struct
from collections.abc import Callable

from uavrt.core.clock import monotonic_s
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.earth.geodesy import distance_m, moved
from uavrt.core.errors import UavrtError
from uavrt.guidance.control.vehicle_commands import VehicleCommand
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.pose_samples import attitude_sample
from uavrt.link.mavlink.autopilot.vehicle_messages import command_message
from uavrt.link.mavlink.dialect import MavCmd, MavModeFlag
from uavrt.link.mavlink.discovery import station_heartbeat
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import FULL_SCALE_DEG, MODES, NOT_GIVEN
from uavrt_experiments.autopilots.tap import Kept, Tap

GROUND_STATION = (255, 190)
HEIGHT_M = 40.0
RATES_HZ = {
    dialect.AttitudeQuaternion.ID: 50.0,
    dialect.GlobalPositionInt.ID: 50.0,
    dialect.ExtendedSysState.ID: 2.0,
    dialect.PositionTargetGlobalInt.ID: 5.0,
}
ARMS_S = 90.0
"""Longest wait for the autopilot to arm [s]."""
CENTRED_US = (1500, 1500, 1500, 1500)
FORCED = 21_196.0
"""Second parameter of a disarm command that also works in flight (MAVLink's magic number)."""
VELOCITY_ONLY = 0b0000_1101_1100_0111


class Foreign(Message):
    """A MAVLink message that uavrt itself neither sends nor reads."""

    __slots__ = ("CRC_EXTRA", "ID", "_payload")

    def __init__(self, number: int, crc_extra: int, payload: bytes) -> None:
        self.ID, self.CRC_EXTRA, self._payload = number, crc_extra, payload  # type: ignore[misc]

    def pack(self) -> bytes:
        """Get the message's payload."""
        return self._payload


class Hand:
    """A simulated pilot: what the ground station receives, and the pilot's commands.

    `tap`: the autopilot's link to ground stations.
    """

    def __init__(self, tap: Tap, flavour: Flavour) -> None:
        self._tap, self.flavour = tap, flavour
        self._writer = FrameWriter(*GROUND_STATION)
        tap.heard = self._take
        self.system_id = 0
        self.mode, self.armed = -1, False
        self.position: dialect.GlobalPositionInt | None = None
        self.target: dialect.PositionTargetGlobalInt | None = None
        self.heading: list[tuple[float, float]] = []
        """Time [s] and heading [deg] of each received attitude."""
        self.on_ground = True
        self.texts: list[str] = []
        self.channels_us: tuple[int, ...] = ()
        """Channels of the remote control [µs]; empty: it is switched off."""
        self.moved: Callable[[float, dialect.GlobalPositionInt], None] = lambda _t, _p: None
        self.check: Callable[[], None] = lambda: None
        """Called while waiting; raises an error if a program has ended."""

    async def live(self) -> None:
        """Send heartbeats and stick positions until cancelled."""
        turn = 0
        while True:
            if turn % 5 == 0:
                self.send(station_heartbeat(as_gcs=True))
            if self.channels_us and self.system_id:
                sticks = struct.pack("<8H", *self.channels_us, *(0,) * 4)
                target = bytes((self.system_id, 1))
                self.send(Foreign(70, 124, sticks + target))
            turn += 1
            await asyncio.sleep(0.2)

    def send(self, message: Message) -> None:
        """Send a message to the autopilot."""
        self._tap.inject(self._writer, message)

    def _take(self, kept: Kept) -> None:
        if kept.frame.component_id != 1:
            return
        message = kept.message
        match message:
            case dialect.Heartbeat() if message.autopilot != dialect.MavAutopilot.INVALID:
                self.system_id = kept.frame.system_id
                self.mode = message.custom_mode
                self.armed = bool(message.base_mode & MavModeFlag.SAFETY_ARMED)
            case dialect.GlobalPositionInt():
                self.position = message
                self.moved(kept.time_s, message)
            case dialect.AttitudeQuaternion():
                sample = attitude_sample(message, 0)
                if sample is not None:
                    self.heading.append((kept.time_s, yaw_deg(sample.quaternion_wxyz)))
            case dialect.PositionTargetGlobalInt():
                self.target = message
            case dialect.ExtendedSysState():
                self.on_ground = message.landed_state == dialect.MavLandedState.ON_GROUND
            case dialect.Statustext():
                self.texts = [*self.texts[-19:], message.text]

    # ------------------------------------------------------------------ what is seen

    @property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude [deg] of the drone; an error before the first position."""
        p = self.position
        assert p is not None
        return p.lat / FULL_SCALE_DEG, p.lon / FULL_SCALE_DEG

    @property
    def height_m(self) -> float:
        """Height of the drone above home [m]."""
        return 0.0 if self.position is None else self.position.relative_alt / 1e3

    @property
    def speed_m_s(self) -> float:
        """Speed of the drone in three dimensions [m/s]."""
        p = self.position
        return 0.0 if p is None else math.hypot(p.vx, p.vy, p.vz) / 100.0

    async def until(self, condition: Callable[[], object], timeout_s: float, what: str) -> None:
        """Wait for a condition; raises `UavrtError` with the autopilot's last message."""
        deadline_s = monotonic_s() + timeout_s
        while not condition():
            self.check()
            if monotonic_s() > deadline_s:
                raise self._error(f"{what} did not come within {timeout_s:.0f} s")
            await asyncio.sleep(0.05)

    def _error(self, what: str) -> UavrtError:
        return UavrtError(
            "; ".join((what, *self.texts[-3:])),
            remedy="Read the autopilot's log in the output directory",
        )

    # ------------------------------------------------------------------ what is done

    def command(self, number: int, *params: float) -> None:
        """Send a COMMAND_LONG to the autopilot."""
        values = (*params, *(0.0,) * 7)[:7]
        self.send(
            dialect.CommandLong(
                target_system=self.system_id,
                target_component=1,
                command=number,
                confirmation=0,
                **{f"param{n}": one for n, one in enumerate(values, 1)},
            )
        )

    def name_mode(self, name: str) -> None:
        """Change the autopilot to a mode of
        `uavrt.simulation.vehicle.simulated_flying.MODES`.
        """
        number, px4 = MODES[self.flavour][name], self.flavour == "px4"
        words = (number >> 16 & 0xFF, number >> 24) if px4 else (number, 0)
        self.command(MavCmd.DO_SET_MODE, 1.0, *map(float, words))

    def set_parameter(self, name: str, value: float, *, whole: bool = False) -> None:
        """Set a parameter of the autopilot; PX4 expects the bytes of a whole number."""
        if whole and self.flavour == "px4":
            (value,) = struct.unpack("<f", struct.pack("<i", round(value)))
        kind = dialect.MavParamType
        self.send(
            dialect.ParamSet(
                target_system=self.system_id,
                target_component=1,
                param_id=name,
                param_value=value,
                param_type=kind.INT32 if whole and self.flavour == "px4" else kind.REAL32,
            )
        )

    def reposition(
        self,
        x: int = NOT_GIVEN,
        y: int = NOT_GIVEN,
        z_m: float = math.nan,
        *,
        yaw_rad: float = math.nan,
    ) -> None:
        """Send a DO_REPOSITION as ground stations do; without a place it is PX4's pause."""
        command = VehicleCommand(
            name="DO_REPOSITION", param1=-1.0, param2=1.0, param4=yaw_rad, x=x, y=y, z_m=z_m
        )
        self.send(command_message(command, self.system_id))

    def fly_to(self, place: tuple[float, float], altitude_amsl_m: float) -> None:
        """Fly to a latitude and longitude [deg]."""
        x, y = (round(one * FULL_SCALE_DEG) for one in place)
        self.reposition(x, y, altitude_amsl_m)

    def go_to(self, north_m: float, east_m: float) -> None:
        """Fly to a place at the present height, given in metres from the drone."""
        p = self.position
        assert p is not None
        self.fly_to(moved(*self.place, self.height_m, north_m, east_m), p.alt / 1e3)

    def set_velocity(self, north_m_s: float, east_m_s: float) -> None:
        """Send a velocity setpoint to the autopilot."""
        values = (0.0, 0.0, 0.0, north_m_s, east_m_s, *(0.0,) * 6)
        payload = struct.pack("<I11fH3B", 0, *values, VELOCITY_ONLY, self.system_id, 1, 1)
        self.send(Foreign(84, 143, payload))

    async def boot(self, timeout_s: float) -> None:
        """Wait for the autopilot, and request the messages that a pilot needs."""
        await self.until(lambda: self.system_id, timeout_s, "the autopilot's heartbeat")
        for number, rate_hz in RATES_HZ.items():
            self.command(MavCmd.SET_MESSAGE_INTERVAL, float(number), 1e6 / rate_hz)
            await asyncio.sleep(0.05)
        await self.until(lambda: self.position is not None, timeout_s, "a position")

    async def arm(self) -> None:
        """Send the arm command once a second until the estimator is ready."""
        deadline_s = monotonic_s() + ARMS_S
        while not self.armed:
            self.check()
            if monotonic_s() > deadline_s:
                raise self._error(f"the autopilot did not arm within {ARMS_S:.0f} s")
            if self.flavour == "ardupilot":
                self.name_mode("hold")
                await asyncio.sleep(0.3)
            self.command(MavCmd.COMPONENT_ARM_DISARM, 1.0)
            await asyncio.sleep(1.0)

    async def hover(self) -> None:
        """Arm, take off at the present place, and hover over home."""
        if not self.armed or self.on_ground:
            await self.arm()
            p = self.position
            assert p is not None
            up_m = HEIGHT_M if self.flavour == "ardupilot" else p.alt / 1e3 + HEIGHT_M
            nothing = math.nan if self.flavour == "px4" else 0.0
            self.command(MavCmd.NAV_TAKEOFF, -1.0, 0, 0, nothing, nothing, nothing, up_m)
            await self.until(lambda: self.height_m > HEIGHT_M - 3.0, 60.0, "its height")
            await asyncio.sleep(2.0)

    async def stand(self) -> None:
        """Land, and wait until the drone is disarmed."""
        if self.armed and not self.on_ground:
            self.name_mode("land")
        elif self.armed:
            self.command(MavCmd.COMPONENT_ARM_DISARM, 0.0)
        await self.until(lambda: not self.armed, 120.0, "the landing")

    async def come_back(self, home: tuple[float, float]) -> None:
        """Fly to a few metres over home, where orders begin."""
        p = self.position
        assert p is not None
        self.fly_to(home, p.alt / 1e3 - self.height_m + HEIGHT_M)
        await asyncio.sleep(1.0)
        await self.until(
            lambda: self.away_m(home) < 3.0 and self.speed_m_s < 0.3, 150.0, "the way back"
        )

    def away_m(self, place: tuple[float, float]) -> float:
        """Horizontal distance of the drone from a place [m]."""
        return distance_m(*self.place, *place)
