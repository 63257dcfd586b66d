"""MAVLink component of the companion computer on the drone, without I/O.

The component receives frames and the time, and sends messages by a given function. It sends
heartbeats, finds the autopilot and the ground stations, requests message streams and
synchronises the clocks. It also answers the requests that MAVLink requires, and passes on pose
samples and tunnel payloads.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from uavrt.config.settings import MavlinkSettings
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.messages import AttitudeSample, Pose, PositionSample
from uavrt.core.newest import Newest
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.link.allowance import Allowance
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.pose_samples import attitude_sample, position_sample
from uavrt.link.mavlink.autopilot.streams import StreamRequests
from uavrt.link.mavlink.autopilot.timesync import STALE_NS, TimeSync
from uavrt.link.mavlink.discovery import Discovery, Peer, own_heartbeat
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.services.command_answers import answer_command
from uavrt.link.mavlink.services.metadata import Metadata
from uavrt.link.mavlink.services.parameter_service import Requests

HEARTBEAT_NS = ns_from_s(1.0)
ALONE_NS = ns_from_s(3.0)
"""Time without an autopilot after which the component uses system number 1 [ns]."""
FALLBACK_SYSTEM_ID = 1
TIMESYNC_FAST_NS = ns_from_s(0.1)
TIMESYNC_SLOW_NS = ns_from_s(1.0)
TIMESYNC_FAST_COUNT = 20
TIMESYNC_PENDING = 32
RADIO_COMPONENT = 68
"""Component id of a telemetry radio (MAV_COMP_ID_TELEMETRY_RADIO); SiK radios send as 51/68."""
RADIO_STATUS_NS = ns_from_s(0.25)
"""Shortest time between two RADIO_STATUS reports of one radio [ns]."""
RADIO_SILENCE_NS = ns_from_s(10.0)
PRIVATE_TYPES = 32_768
"""Lowest TUNNEL payload type that MAVLink leaves free for private use."""
REBOOT_FALL_MS = 1000
"""Fall of the autopilot's boot time that means a reboot, not reordered messages [ms]."""


ANSWERS_BURST, ANSWERS_PER_S = 24, 4
"""Answers to peers other than the autopilot: most at once, and per second. Enough for pings of
a few stations once a second, and for the requests of a station that connects."""

DEFAULTS: Final = MavlinkSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Handlers:
    """Callbacks that a component calls with received messages and payloads."""

    attitude: Callable[[AttitudeSample], None]
    position: Callable[[PositionSample], None]
    tunnel: Callable[[bytes, Peer], None]
    """Called with the valid bytes of a tunnel payload of type 0, and its sender."""
    private: Callable[[int, bytes, Peer], None] = lambda kind, payload, peer: None
    """Called with the type, payload and sender of a tunnel message of a private type."""
    ftp: Callable[[bytes, Peer], None] = lambda payload, peer: None
    """Called with the payload and sender of a file transfer (MAVLink FTP) request."""
    radio_status: Callable[[dialect.RadioStatus], None] = lambda status: None
    """Called with each RADIO_STATUS of the telemetry radio."""
    parameters: Callable[[Requests, Peer], None] = lambda request, peer: None
    """Called with a request for parameters of this component, and its sender."""
    vehicle: Callable[[Message, int], None] = lambda message, now_ns: None
    """Called with each message of the autopilot and its time of arrival [ns]."""
    autopilot_found: Callable[[], None] = lambda: None
    """Called when an autopilot is found, or replaced by another one."""


class Component:
    """MAVLink component of the companion computer, on the autopilot's system.

    `send`: sends a message at once, from this object's `system_id` and `component_id`.
    `handlers`: callbacks for what is received. `watched_hz`: further message ids to request,
    with their rates. `own_system_id`: system number of a station without an autopilot; None:
    take the number of the autopilot.
    """

    def __init__(
        self,
        send: Callable[[Message], None],
        handlers: Handlers,
        settings: MavlinkSettings = DEFAULTS,
        *,
        watched_hz: Mapping[int, float] = MappingProxyType({}),
        own_system_id: int | None = None,
    ) -> None:
        self._own_system_id = own_system_id
        self._send = send
        self._handlers = handlers
        self._encoding = settings.parameter_encoding
        self.metadata: Metadata | None = None
        """COMPONENT_METADATA message sent on request; None if no files are served."""
        self.component_id = settings.component_id
        self.discovery = Discovery()
        self.time_sync = TimeSync()
        self.streams = StreamRequests(
            {
                dialect.AttitudeQuaternion.ID: settings.attitude_rate_hz,
                dialect.GlobalPositionInt.ID: settings.position_rate_hz,
                dialect.SystemTime.ID: 1.0,
                **watched_hz,
            }
        )
        self.counters: Counter[str] = Counter()
        self._answers = Allowance(burst=ANSWERS_BURST, per_s=ANSWERS_PER_S)
        self._started_ns: int | None = None
        self._heartbeat_ns: int | None = None
        self._timesync_ns = 0
        self._requests: Newest[int, None] = Newest(TIMESYNC_PENDING)
        self._requests_sent = 0
        self._first_asked_ns = 0
        self._boot_ms = -1
        self._radios: dict[int, tuple[Peer, int]] = {}

    @property
    def system_id(self) -> int:
        """MAVLink system number: the autopilot's (1 while unknown), or the station's own."""
        if self._own_system_id is not None:
            return self._own_system_id
        autopilot = self.discovery.autopilot
        return FALLBACK_SYSTEM_ID if autopilot is None else autopilot.system_id

    @property
    def parameters_bytewise(self) -> bool:
        """True if parameter messages hold the bytes of integers, False if float values."""
        if self._encoding in ("bytewise", "c_cast"):
            return self._encoding == "bytewise"
        return self.discovery.autopilot_kind != dialect.MavAutopilot.ARDUPILOTMEGA

    def status(self, now_ns: int) -> str:
        """Missing part of the link in one or two words; ``"ready"`` if nothing is missing."""
        if self._own_system_id is None and not self.discovery.autopilot_present(now_ns):
            return "waiting for autopilot"
        if self._own_system_id is None and not self.time_sync.synchronized:
            return "waiting for time"
        if not self.discovery.station_present(now_ns):
            return "waiting for ground station"
        return "ready"

    def has_number(self, now_ns: int) -> bool:
        """True once the system number is known, or after `ALONE_NS` without an autopilot."""
        if self._own_system_id is not None or self.discovery.autopilot is not None:
            return True
        return self._started_ns is not None and now_ns - self._started_ns >= ALONE_NS

    def tick(self, now_ns: int) -> None:
        """Send heartbeats and requests that are due; call it about every 50 ms."""
        if self._started_ns is None:
            self._started_ns = now_ns
        if self._heartbeat_due(now_ns):
            self._heartbeat_ns = now_ns
            self._send(own_heartbeat(dialect.MavType.ONBOARD_CONTROLLER))
        autopilot = self.discovery.autopilot
        if autopilot is None or not self.discovery.autopilot_present(now_ns):
            return
        request = self.streams.next_request(autopilot, now_ns)
        if request is not None:
            self._send(request)
        fast = self._requests_sent < TIMESYNC_FAST_COUNT
        if now_ns - self._timesync_ns >= (TIMESYNC_FAST_NS if fast else TIMESYNC_SLOW_NS):
            self._request_time(autopilot, now_ns)

    def receive(self, frame: Frame, now_ns: int, link: int = 0) -> None:
        """Handle a frame that arrived at `now_ns` by link number `link`."""
        if frame.system_id == self.system_id and frame.component_id == self.component_id:
            self.counters["own_frames"] += 1  # routed back to us, or another with our number
            return
        message = frame.message()
        if message is None:
            self.counters["other_messages"] += 1
            return
        peer = Peer(frame.system_id, frame.component_id, link)
        if isinstance(message, dialect.Timesync) and message.tc1 != 0:
            self._handle_time(message, peer, now_ns)
            return
        if not self._is_for_us(message):
            self.counters["for_others"] += 1
            return
        self._dispatch(message, peer, now_ns)

    def send_pose(self, pose: Pose, now_ns: int) -> None:
        """Send the pose of a station without autopilot to ground stations."""
        uptime_ms = self._uptime_ms(now_ns)
        w, x, y, z = pose.quaternion_wxyz
        self._send(dialect.AttitudeQuaternion(time_boot_ms=uptime_ms, q1=w, q2=x, q3=y, q4=z))
        self._send(
            dialect.GlobalPositionInt(
                time_boot_ms=uptime_ms,
                lat=round(pose.latitude_deg * 1e7),
                lon=round(pose.longitude_deg * 1e7),
                alt=round(pose.altitude_amsl_m * 1e3),
                relative_alt=round(pose.altitude_relative_m * 1e3),
                hdg=round(yaw_deg(pose.quaternion_wxyz) * 100.0) % 36_000,
            )
        )

    def clock_is_stale(self, now_ns: int) -> bool:
        """True if an autopilot is present, but its clock has not been received for 10 s."""
        asked = self._requests_sent > 0 and now_ns - self._first_asked_ns > STALE_NS
        return (
            asked
            and self.discovery.autopilot_present(now_ns)
            and self.time_sync.is_stale(now_ns)
        )

    def late_s(self, message: Message, arrived_ns: int) -> float | None:
        """Delay of an autopilot's message on the link, by TIMESYNC [s]; None if unknown."""
        boot_ms = getattr(message, "time_boot_ms", None)
        if boot_ms is None or not self.time_sync.synchronized:
            return None
        made_ns = self.time_sync.local_ns(boot_ms * 1_000_000)
        return None if made_ns is None else (arrived_ns - made_ns) / NANOSECONDS_PER_SECOND

    def _uptime_ms(self, now_ns: int) -> int:
        return (now_ns - (self._started_ns or now_ns)) // 1_000_000 % 2**32

    def _dispatch(self, message: Message, peer: Peer, now_ns: int) -> None:
        if peer == self.discovery.autopilot:
            self.streams.received(message.ID, now_ns)
            self._handlers.vehicle(message, now_ns)
        match message:
            case dialect.AttitudeQuaternion() | dialect.GlobalPositionInt():
                self._pose(message, peer, now_ns)
            case dialect.SystemTime() if peer == self.discovery.autopilot:
                self.streams.received(message.ID, now_ns)
                self._watch_boot_time(message.time_boot_ms, now_ns)
            case dialect.Heartbeat():
                if self.discovery.heartbeat(peer, message, now_ns):
                    self._new_autopilot(now_ns)
            case dialect.ExtendedSysState() if peer == self.discovery.autopilot:
                state = message.landed_state
                on_ground = state == dialect.MavLandedState.ON_GROUND
                known = state != dialect.MavLandedState.UNDEFINED
                self.discovery.autopilot_landed = on_ground if known else None
            case dialect.Tunnel():
                self._tunnel(message, peer)
            case dialect.FileTransferProtocol():
                self._handlers.ftp(message.payload, peer)
            case dialect.ParamRequestList() | dialect.ParamRequestRead() | dialect.ParamSet():
                self._handlers.parameters(message, peer)
            case dialect.RadioStatus():
                self._radio_status(message, peer, now_ns)
            case dialect.Timesync() if self._may_answer(peer, now_ns):
                self._send(dialect.Timesync(tc1=now_ns, ts1=message.ts1, **peer.address))
            case dialect.Ping() if message.target_system == 0 and self._may_answer(
                peer, now_ns
            ):
                time_us, number = message.time_usec, message.seq
                self._send(dialect.Ping(time_usec=time_us, seq=number, **peer.address))
            case dialect.CommandAck() if peer == self.discovery.autopilot:
                self.streams.acknowledged(message)
            case dialect.CommandLong() | dialect.CommandInt() if self._may_answer(peer, now_ns):
                self._command(message, peer, now_ns)

    def _radio_status(self, message: dialect.RadioStatus, peer: Peer, now_ns: int) -> None:
        """Pass on the report of one radio per link, at most every `RADIO_STATUS_NS`."""
        is_radio = peer.component_id == RADIO_COMPONENT or peer == self.discovery.autopilot
        radio, heard_ns = self._radios.get(peer.link, (peer, now_ns - RADIO_SILENCE_NS))
        if not is_radio or (peer != radio and now_ns - heard_ns < RADIO_SILENCE_NS):
            self.counters["radio_status_of_others"] += 1
        elif now_ns - heard_ns < RADIO_STATUS_NS:
            self.counters["radio_status_too_often"] += 1
        else:
            self._radios[peer.link] = peer, now_ns
            self._handlers.radio_status(message)

    def _may_answer(self, peer: Peer, now_ns: int) -> bool:
        """True if `peer` may be answered now; only the autopilot is not rate-limited."""
        if peer == self.discovery.autopilot or self._answers.take(now_ns):
            return True
        self.counters["questions_passed_over"] += 1
        return False

    def _is_for_us(self, message: Message) -> bool:
        """True if a message is for this component or for all (0), or has no address."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.system_id) and component in (0, self.component_id)

    def _heartbeat_due(self, now_ns: int) -> bool:
        assert self._started_ns is not None
        if not self.has_number(now_ns):
            return False
        return self._heartbeat_ns is None or now_ns - self._heartbeat_ns >= HEARTBEAT_NS

    def _new_autopilot(self, now_ns: int) -> None:
        self.counters["autopilots_found"] += 1
        self._restart_clock(now_ns)
        self._heartbeat_ns = None  # so that it routes to us at once
        self._handlers.autopilot_found()

    def _restart_clock(self, now_ns: int) -> None:
        self.time_sync.reset()
        self.streams.restart(now_ns)
        self._requests.clear()
        self._requests_sent = 0
        self._boot_ms = -1

    def _watch_boot_time(self, boot_ms: int, now_ns: int) -> None:
        """Detect a reboot: the boot time falls, other than at its wrap after 49.7 days."""
        if boot_ms + REBOOT_FALL_MS < self._boot_ms:
            self.counters["autopilot_reboots"] += 1
            self._restart_clock(now_ns)
        self._boot_ms = max(boot_ms, self._boot_ms)

    def _pose(
        self,
        message: dialect.AttitudeQuaternion | dialect.GlobalPositionInt,
        peer: Peer,
        now_ns: int,
    ) -> None:
        if peer != self.discovery.autopilot:
            self.counters["foreign_poses"] += 1
            return
        self.streams.received(message.ID, now_ns)
        self._watch_boot_time(message.time_boot_ms, now_ns)
        boot_ns = message.time_boot_ms * 1_000_000
        if not self.time_sync.synchronized:
            self.time_sync.add_one_way(boot_ns, now_ns)
        time_ns = self.time_sync.local_ns(boot_ns)
        if time_ns is None:
            self.counters["poses_without_time"] += 1
        elif isinstance(message, dialect.AttitudeQuaternion):
            attitude = attitude_sample(message, time_ns)
            if attitude is None:
                self.counters["bad_attitudes"] += 1
            else:
                self._handlers.attitude(attitude)
        else:
            position = position_sample(message, time_ns)
            if position is None:
                self.counters["positions_without_fix"] += 1
            else:
                self._handlers.position(position)

    def _tunnel(self, message: dialect.Tunnel, peer: Peer) -> None:
        if message.payload_length > len(message.payload):
            self.counters["bad_tunnels"] += 1
            return
        self.counters["tunnels_received"] += 1
        payload = message.payload[: message.payload_length]
        if message.payload_type == 0:
            self._handlers.tunnel(payload, peer)
        elif message.payload_type >= PRIVATE_TYPES:
            self._handlers.private(message.payload_type, payload, peer)
        else:
            self.counters["tunnels_of_others"] += 1

    def _request_time(self, autopilot: Peer, now_ns: int) -> None:
        self._timesync_ns = now_ns
        if self._requests_sent == 0:
            self._first_asked_ns = now_ns
        self._requests_sent += 1
        self._requests[now_ns] = None
        self._send(dialect.Timesync(ts1=now_ns, **autopilot.address))

    def _handle_time(self, message: dialect.Timesync, peer: Peer, now_ns: int) -> None:
        """Handle the autopilot's answer to a TIMESYNC request, which `ts1` identifies.

        The target fields of the answer are not checked, because PX4 1.17 leaves them
        uninitialised.
        """
        if peer != self.discovery.autopilot or message.ts1 not in self._requests:
            self.counters["timesync_foreign"] += 1
            return
        del self._requests[message.ts1]
        self.time_sync.add_round_trip(message.ts1, message.tc1, now_ns)

    def _command(
        self, message: dialect.CommandLong | dialect.CommandInt, peer: Peer, now_ns: int
    ) -> None:
        uptime_ms = self._uptime_ms(now_ns)
        direct = message.target_component == self.component_id
        for answer in answer_command(
            message,
            peer,
            direct=direct,
            uptime_ms=uptime_ms,
            bytewise=self.parameters_bytewise,
            metadata=self.metadata,
        ):
            self._send(answer)
        if direct:
            self.counters["commands"] += 1
