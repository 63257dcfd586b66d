"""State of the vehicle from MAVLink: pose, radio, battery and frame loss. No I/O."""

import math
from collections import deque
from dataclasses import dataclass

from uavrt.core.messages import Pose
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT, VehicleIdentity
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.pose_samples import attitude_sample, is_place, position_sample
from uavrt.link.mavlink.dialect import MavCmd, MavComponent
from uavrt.link.mavlink.discovery import Peer, request_message
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.message import Message

POSE_SILENCE_NS = ns_from_s(3.0)
REQUEST_REPEAT_NS = ns_from_s(5.0)
REQUESTED_HZ = 5.0
"""Rate of attitude and position requested from an autopilot that sends none [Hz]; both together
take 0.4 kB/s."""
IDENTITY_REPEAT_NS = ns_from_s(20.0)
LOSS_WINDOW_NS = ns_from_s(30.0)
SILENCE_NS = ns_from_s(6.0)
"""Time without frames after which the frame loss of the link is unknown [ns]."""
UNKNOWN_HEADING = 65_535
UNKNOWN_VOLTAGE = 65_535
UNKNOWN_SPACE = 0xFFFF_FFFF


class LossMeter:
    """Measures the recent frame loss of a MAVLink component by gaps in its sequence numbers."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque()
        self._last: int | None = None

    def add(self, sequence: int, now_ns: int) -> None:
        """Add the sequence number (0 to 255) of a frame."""
        step = 1 if self._last is None else (sequence - self._last) % 256 or 256
        # A step of more than half the circle is a sender that started again.
        self._seen.append((now_ns, step if step < 128 else 1))
        self._last = sequence
        while self._seen[0][0] < now_ns - LOSS_WINDOW_NS:
            self._seen.popleft()

    def share(self, now_ns: int) -> float | None:
        """Share of lost frames, 0 to 1; None after a silence of `SILENCE_NS`."""
        if not self._seen or self._seen[-1][0] < now_ns - SILENCE_NS:
            return None
        sent = sum(step for time_ns, step in self._seen if time_ns >= now_ns - LOSS_WINDOW_NS)
        heard = sum(1 for time_ns, _ in self._seen if time_ns >= now_ns - LOSS_WINDOW_NS)
        return None if sent == 0 else 1.0 - heard / sent


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioLevels:
    """Signal and noise levels of the telemetry radio (RADIO_STATUS, manufacturer's units)."""

    rssi: int
    remote_rssi: int
    noise: int
    remote_noise: int
    transmit_buffer_percent: int
    errors: int


class VehicleWatch:
    """Reads pose, battery and radio state of the vehicle `identity` from the link's frames."""

    def __init__(self, own: Peer, identity: VehicleIdentity | None = None) -> None:
        self._own = own
        self.identity = VehicleIdentity() if identity is None else identity
        self._forget()

    def _forget(self) -> None:
        self.autopilot: Peer | None = None
        self.armed: bool | None = None
        self.landed: bool | None = None
        """True if the autopilot reports that it is on the ground; None: not reported."""
        self.pose: Pose | None = None
        """The vehicle's latest pose, timed by the ground's clock; None: not received."""
        self.home: tuple[float, float] | None = None
        """Home position, latitude and longitude [deg]; None: not reported."""
        self.radio: RadioLevels | None = None
        self.battery_v: float | None = None
        self.battery_percent: int | None = None
        self.disk_free_mb: float | None = None
        """Free space on the drone's flight disk [MB]; None: not reported."""
        self.round_trip_s: float | None = None
        """Round-trip time of the last ping to the onboard computer [s]; None: unknown."""
        self.loss = LossMeter()
        self._attitude: tuple[float, float, float, float] | None = None
        self._heard_ns = 0
        self._asked_ns = 0
        self._facts_asked_ns = 0
        self._ping_number = 0

    def receive(self, frame: Frame, now_ns: int) -> Pose | None:
        """Handle a frame; return the vehicle's pose if its position is new, else None."""
        message = frame.message()
        if isinstance(message, dialect.RadioStatus):
            self.radio = RadioLevels(
                rssi=message.rssi,
                remote_rssi=message.remrssi,
                noise=message.noise,
                remote_noise=message.remnoise,
                transmit_buffer_percent=message.txbuf,
                errors=message.rxerrors,
            )
            return None
        if isinstance(message, dialect.Ping) and frame.component_id == DRONE_COMPONENT:
            if self._is_ours(frame.system_id):
                self._receive_ping(message, now_ns)
            return None
        if isinstance(message, dialect.OnboardComputerStatus):
            if frame.component_id == DRONE_COMPONENT and self._is_ours(frame.system_id):
                self._receive_computer_status(message)
            return None
        if frame.component_id == DRONE_COMPONENT and self._alone(frame.system_id, now_ns):
            pose = self._receive_pose(message, now_ns)
            if pose is not None:
                self.identity.receive_position((pose.latitude_deg, pose.longitude_deg), now_ns)
            return pose
        if frame.component_id != MavComponent.COMP_ID_AUTOPILOT1:
            return None
        peer = Peer(frame.system_id, frame.component_id)
        ours = self.identity.system_id
        if isinstance(message, dialect.Heartbeat):
            self._handle_heartbeat(peer, now_ns)
        if peer != self.autopilot or (ours is not None and peer.system_id != ours):
            return None
        self._heard_ns = now_ns
        self.loss.add(frame.sequence, now_ns)
        return self._take(message, now_ns)

    def _is_ours(self, system_id: int) -> bool:
        return self.identity.system_id in (None, system_id)

    def _alone(self, system_id: int, now_ns: int) -> bool:
        """True for a station without an autopilot, such as a mast or a person on foot."""
        return system_id == self.identity.system_id and not self.present(now_ns)

    def _handle_heartbeat(self, peer: Peer, now_ns: int) -> None:
        """Handle a heartbeat of the vehicle's autopilot (any, before a vehicle is chosen)."""
        ours = self.identity.system_id
        if ours is None:
            if not self.present(now_ns) and peer.system_id not in self.identity.excluded:
                self.autopilot = peer
        elif self.identity.heard(peer.system_id, now_ns) and peer != self.autopilot:
            self._forget()  # what was known is another vehicle's
            self.autopilot = peer

    def present(self, now_ns: int) -> bool:
        """True while messages of the autopilot arrive."""
        return self.autopilot is not None and now_ns - self._heard_ns < ns_from_s(5.0)

    def requests(self, now_ns: int) -> list[Message]:
        """Return messages that request poses if none arrive; ArduPilot needs the request."""
        silent = self.pose is None or now_ns - self.pose.time_ns > POSE_SILENCE_NS
        if not (
            silent and self.present(now_ns) and now_ns - self._asked_ns > REQUEST_REPEAT_NS
        ):
            return []
        self._asked_ns = now_ns
        assert self.autopilot is not None
        return [
            _interval(self.autopilot, message_id, 1e6 / REQUESTED_HZ)
            for message_id in (dialect.AttitudeQuaternion.ID, dialect.GlobalPositionInt.ID)
        ]

    def questions(self, now_ns: int) -> list[Message]:
        """Return requests due now for the autopilot's version, home and battery."""
        due = self._facts_asked_ns == 0 or now_ns - self._facts_asked_ns > IDENTITY_REPEAT_NS
        if not (due and self.present(now_ns)):
            return []
        self._facts_asked_ns = now_ns
        assert self.autopilot is not None
        facts = (dialect.AutopilotVersion.ID, dialect.HomePosition.ID, dialect.SysStatus.ID)
        messages: list[Message] = [request_message(self.autopilot, one) for one in facts]
        if self.landed is None:
            messages.append(_interval(self.autopilot, dialect.ExtendedSysState.ID, 1e6))
        return messages

    def ping(self, now_ns: int) -> Message:
        """Make the next ping, addressed to all components; the drone's computer answers it."""
        self._ping_number += 1
        return dialect.Ping(
            time_usec=now_ns // 1000,
            seq=self._ping_number & 0xFFFFFFFF,
            target_system=0,
            target_component=0,
        )

    def _take(self, message: Message | None, now_ns: int) -> Pose | None:
        match message:
            case dialect.Heartbeat():
                self.armed = bool(message.base_mode & dialect.MavModeFlag.SAFETY_ARMED)
            case dialect.ExtendedSysState():
                state = message.landed_state
                known = state != dialect.MavLandedState.UNDEFINED
                self.landed = state == dialect.MavLandedState.ON_GROUND if known else None
            case dialect.SysStatus():
                known = message.voltage_battery != UNKNOWN_VOLTAGE
                self.battery_v = message.voltage_battery / 1000.0 if known else None
                percent = message.battery_remaining
                self.battery_percent = percent if 0 <= percent <= 100 else None
            case dialect.AutopilotVersion():
                self.identity.receive_version(message, now_ns)
            case dialect.HomePosition() if is_place(message.latitude, message.longitude):
                self.home = (message.latitude / 1e7, message.longitude / 1e7)
            case _ if not self.identity.foreign(now_ns):
                return self._receive_pose(message, now_ns)
        return None

    def _receive_pose(self, message: Message | None, now_ns: int) -> Pose | None:
        match message:
            case dialect.AttitudeQuaternion():
                attitude = attitude_sample(message, now_ns)
                if attitude is not None:
                    self._attitude = attitude.quaternion_wxyz
            case dialect.GlobalPositionInt():
                return self._receive_position(message, now_ns)
        return None

    def _receive_position(self, message: dialect.GlobalPositionInt, now_ns: int) -> Pose | None:
        position = position_sample(message, now_ns)
        if position is None:
            return None
        attitude = self._attitude
        if attitude is None:
            if message.hdg == UNKNOWN_HEADING:
                return None
            half = math.radians(message.hdg / 100.0) / 2.0
            attitude = (math.cos(half), 0.0, 0.0, math.sin(half))
        self.pose = Pose(
            time_ns=now_ns,
            latitude_deg=position.latitude_deg,
            longitude_deg=position.longitude_deg,
            altitude_amsl_m=position.altitude_amsl_m,
            altitude_relative_m=position.altitude_relative_m,
            quaternion_wxyz=attitude,
        )
        return self.pose

    def _receive_computer_status(self, message: dialect.OnboardComputerStatus) -> None:
        used_mib, whole_mib = message.storage_usage[0], message.storage_total[0]
        known = UNKNOWN_SPACE not in (used_mib, whole_mib) and whole_mib > 0
        self.disk_free_mb = (whole_mib - used_mib) * 2**20 / 1e6 if known else None

    def _receive_ping(self, message: dialect.Ping, now_ns: int) -> None:
        if self._own != Peer(message.target_system, message.target_component):
            return
        passed_ns = now_ns - message.time_usec * 1000
        if message.seq == self._ping_number & 0xFFFFFFFF and passed_ns >= 0:
            self.round_trip_s = passed_ns / NANOSECONDS_PER_SECOND


def _interval(peer: Peer, message_id: int, interval_us: float) -> Message:
    return dialect.CommandLong(
        **peer.address,
        command=MavCmd.SET_MESSAGE_INTERVAL,
        param1=float(message_id),
        param2=interval_us,
    )
