"""Create the messages of a simulated autopilot whose vehicle obeys commands."""

from collections.abc import Callable
from pathlib import Path

from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.messages import Pose
from uavrt.core.units import ns_from_s, s_from_ns
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.message import Message
from uavrt.simulation.scene.flown_path import PathWriter
from uavrt.simulation.scene.geometry import TangentPlane
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import FlyingVehicle
from uavrt.simulation.vehicle.vehicle_telemetry import (
    home_message,
    landed_message,
    position_message,
    target_message,
    wind_message,
)

STEP_NS = ns_from_s(0.02)
SLOWEST_NS: dict[str, dict[int, int]] = {
    "px4": {dialect.CurrentMode.ID: ns_from_s(0.5)},
    "ardupilot": {},
}
"""Message periods that a request cannot change [ns], by autopilot and message id: CURRENT_MODE
of PX4 1.17."""
_OF_VEHICLE: dict[int, Callable[[FlyingVehicle, int], Message | None]] = {
    dialect.GlobalPositionInt.ID: position_message,
    dialect.PositionTargetGlobalInt.ID: target_message,
    dialect.HomePosition.ID: lambda vehicle, _: home_message(vehicle),
    dialect.CurrentMode.ID: lambda vehicle, _: dialect.CurrentMode(
        custom_mode=vehicle.mode, intended_custom_mode=vehicle.mode
    ),
    dialect.ExtendedSysState.ID: lambda vehicle, _: landed_message(vehicle),
    dialect.Wind.ID: wind_message,
    dialect.WindCov.ID: wind_message,
}
"""Functions that create a message from the vehicle and the time since boot [ms], by message
id."""
FLOWN_IDS = frozenset({*_OF_VEHICLE, dialect.RcChannels.ID, dialect.SysStatus.ID})
_BOTH = FLOWN_IDS - {dialect.CurrentMode.ID, dialect.Wind.ID, dialect.WindCov.ID}
REQUESTABLE_IDS: dict[str, frozenset[int]] = {
    "px4": _BOTH | {dialect.CurrentMode.ID, dialect.WindCov.ID},
    "ardupilot": _BOTH | {dialect.Heartbeat.ID, dialect.Wind.ID},
}
"""Ids of requestable messages, by autopilot: PX4 refuses HEARTBEAT, ArduPilot CURRENT_MODE."""
CENTRE_US = 1500


class Flown:
    """Moves a commanded vehicle in real time and creates its messages.

    `start`: position at which the vehicle hovers until it is commanded. `sticks`: True if a
    remote control is switched on. `path`: file to which the vehicle's path is written
    (`uavrt.simulation.scene.flown_path`). `on_ground`: True if the vehicle is at first disarmed
    on the ground below `start`.
    """

    def __init__(
        self,
        start: Pose,
        flavour: Flavour,
        sticks: bool,
        path: Path | None = None,
        *,
        on_ground: bool = False,
    ) -> None:
        home_amsl = start.altitude_amsl_m - start.altitude_relative_m
        plane = TangentPlane(
            latitude_deg=start.latitude_deg,
            longitude_deg=start.longitude_deg,
            altitude_amsl_m=home_amsl,
        )
        self.vehicle = FlyingVehicle(
            flavour,
            plane,
            height_m=0.0 if on_ground else start.altitude_relative_m,
            armed=not on_ground,
        )
        self.channels_us = (CENTRE_US,) * 4 if sticks else ()
        self._time_ns = start.time_ns
        self._mode_reported = self.vehicle.mode
        self._writer = None if path is None else PathWriter(path)

    def advance(self, now_ns: int) -> bool:
        """Move the vehicle up to the present time; return True if the mode has changed."""
        mode = self.vehicle.mode
        changed = mode != self._mode_reported
        self._mode_reported = mode
        gone: list[tuple[Pose, float]] = []
        while self._time_ns + STEP_NS <= now_ns:
            self._time_ns += STEP_NS
            self.vehicle.advance(s_from_ns(STEP_NS))
            gone.append((self.pose(self._time_ns), self.vehicle.heading.yaw_deg))
        if self._writer is not None and gone:
            self._writer.add(gone)
        return changed

    def pose(self, time_ns: int) -> Pose:
        """Pose of the vehicle after the last step; its time is the requested time."""
        vehicle = self.vehicle
        latitude, longitude = vehicle.latitude_longitude()
        height = vehicle.body.shown_height_m
        return Pose(
            time_ns=time_ns,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_amsl_m=vehicle.plane.altitude_amsl_m + height,
            altitude_relative_m=height - vehicle.ground.home_up_m,
            quaternion_wxyz=from_euler_deg(vehicle.heading.yaw_deg, 0.0, 0.0),
        )

    def message(self, message_id: int, boot_ms: int) -> Message | None:
        """Create the message with this id; None if the vehicle has no such data."""
        if message_id in _OF_VEHICLE:
            return _OF_VEHICLE[message_id](self.vehicle, boot_ms)
        return self._sticks(boot_ms) if message_id == dialect.RcChannels.ID else self.status()

    def _sticks(self, boot_ms: int) -> dialect.RcChannels | None:
        if not self.channels_us:
            return None
        channels = dict.fromkeys((f"chan{n}_raw" for n in range(5, 19)), 65_535)
        channels |= {f"chan{n + 1}_raw": one for n, one in enumerate(self.channels_us)}
        return dialect.RcChannels(
            time_boot_ms=boot_ms & 0xFFFFFFFF, chancount=8, rssi=200, **channels
        )

    def status(self) -> dialect.SysStatus:
        """Create the battery status message."""
        return dialect.SysStatus(
            load=300,
            voltage_battery=16_200,
            current_battery=-1,
            battery_remaining=round(self.vehicle.body.battery_percent),
        )
