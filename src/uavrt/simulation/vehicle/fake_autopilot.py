"""A simulated autopilot that speaks MAVLink to a companion computer and a ground station.

It streams the vehicle's pose, answers as a real autopilot does, and forwards messages between
its two links as PX4 1.17 or ArduCopter 4.7 do. It can run alone; ``--ground HOST:PORT`` adds a
ground station::

    python -m uavrt.simulation.autopilot --scenario FILE --companion HOST:PORT
"""

import asyncio
import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from uavrt.core.clock import Clock
from uavrt.core.log import get_logger
from uavrt.core.messages import Pose
from uavrt.core.units import ns_from_s, s_from_ns
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavCmd, MavProtocolCapability, MavResult
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.autopilot_parameters import (
    COMPANION_PORT,
    GROUND_PORT,
    AutopilotParameters,
)
from uavrt.simulation.vehicle.commanded_vehicle import (
    FLOWN_IDS,
    REQUESTABLE_IDS,
    SLOWEST_NS,
    Flown,
)
from uavrt.simulation.vehicle.datagrams import DatagramPort
from uavrt.simulation.vehicle.forwarding import ForwardRing, Impairment, Routes
from uavrt.simulation.vehicle.mission_store import MissionStore
from uavrt.simulation.vehicle.vehicle_telemetry import (
    default_intervals_ns,
    home_message,
    telemetry_message,
)

log = get_logger()


BUSY_WAKE_S = 0.004
"""Period of the main loop while messages wait [s]; that of PX4 in simulation."""
IDLE_WAKE_S = 0.010
HEARTBEAT_NS = ns_from_s(1.0)
TIMESYNC_NS: dict[Flavour, int] = {"px4": ns_from_s(0.1), "ardupilot": ns_from_s(10.0)}
CAPABILITIES = (
    MavProtocolCapability.MISSION_INT
    | MavProtocolCapability.COMMAND_INT
    | MavProtocolCapability.MAVLINK2
    | MavProtocolCapability.MISSION_FENCE
)
REBOOT_NS = ns_from_s(1.5)
"""Duration of the autopilot's restart, in which it sends no messages [ns]."""
MAX_LATE_NS = ns_from_s(0.5)
"""Delay above which telemetry is skipped because this program was paused [ns]."""
ARDUPILOT_RING = 256 * 149
ARDUPILOT_PASS_NS = 1_000
"""Time between two messages forwarded by a simulated ArduPilot [ns]. The real one has no such
gap; without it, more than 256 messages at once overflowed a receiving socket."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotSettings:
    """Kind of the simulated autopilot, quality of its links and state of its vehicle."""

    companion: tuple[str, int]
    """Address of the companion computer; PX4's onboard link sends to port 14540."""
    ground: tuple[str, int] | None = None
    """Address of the ground station; PX4's ground link sends to port 14550."""
    flavour: Flavour = "px4"
    system_id: int = 1
    unique_number: int = 0x75617672
    """Hardware id that the autopilot reports in AUTOPILOT_VERSION."""
    companion_port: int = 0
    """Local UDP port towards the companion computer; 0: any free one."""
    ground_port: int = 0
    clock_skew_ppm: float = 0.0
    """Rate error of the boot clock relative to UTC [ppm]; PX4 in simulation has -15 000."""
    mute_clock: bool = False
    """True to leave TIMESYNC messages unanswered."""
    boot_time_s: float = 20.0
    companion_jitter_s: float = 0.0
    ground_jitter_s: float = 0.0
    companion_loss: float = 0.0
    ground_loss: float = 0.0
    """Probability that a frame is lost on the ground link, in each direction."""
    seed: int = 1
    armed: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    flies: bool = False
    """True to hover at first and obey commands; False to fly the scenario's flight."""
    sticks: bool = False
    """True to simulate a remote control that is switched on, with its sticks centred."""
    on_ground: bool = False
    """True to begin on the ground and wait for arming; only with `flies`."""
    path: Path | None = None
    """File to which a commanded vehicle writes its path, for the simulated radio."""


class _LinkSide:
    """One of the autopilot's two links, with its queue, losses and delays."""

    def __init__(self, name: str, settings: AutopilotSettings, *, loss: float, jitter_s: float):
        self.name = name
        px4 = settings.flavour == "px4"
        self.ring = ForwardRing() if px4 else ForwardRing(ARDUPILOT_RING, ARDUPILOT_PASS_NS)
        self.routes = Routes()
        self.parser = FrameParser()
        self.writer = FrameWriter(settings.system_id, 1)
        seeds = (2 * settings.seed, 2 * settings.seed + 1)
        self.inward = Impairment(loss=loss, jitter_s=jitter_s, seed=seeds[0])
        self.outward = Impairment(loss=loss, jitter_s=jitter_s, seed=seeds[1])
        self.port: DatagramPort | None = None
        self.intervals_ns: dict[int, int] = {}
        self.due_ns: dict[int, int] = {}


class FakeAutopilot:
    """The simulated autopilot; `run` serves it until cancelled.

    `vehicle`: pose of the vehicle at a time [ns, UTC]. `settings`: kind, peers and links.
    `clock`: UTC; the boot clock derives from it.
    """

    def __init__(
        self, vehicle: Callable[[int], Pose], settings: AutopilotSettings, clock: Clock
    ) -> None:
        self._vehicle = vehicle
        self._settings = settings
        self._clock = clock
        self.parameters = AutopilotParameters(settings.flavour, settings.parameters)
        self.missions = MissionStore(settings.flavour)
        self._booted_ns = clock.now_ns() - ns_from_s(settings.boot_time_s)
        self._silent_until_ns = 0
        self._heartbeat_ns = 0
        self._timesync_ns = 0
        self._px4 = settings.flavour == "px4"
        self._random = random.Random(settings.seed)
        self.companion = _LinkSide(
            "companion",
            settings,
            loss=settings.companion_loss,
            jitter_s=settings.companion_jitter_s,
        )
        self.ground = _LinkSide(
            "ground", settings, loss=settings.ground_loss, jitter_s=settings.ground_jitter_s
        )
        self.flown: Flown | None = None
        """The vehicle that obeys commands; None if it flies the scenario's flight."""
        if settings.flies:
            self.flown = Flown(
                vehicle(clock.now_ns()),
                settings.flavour,
                settings.sticks,
                settings.path,
                on_ground=settings.on_ground,
            )
            self._vehicle = self.flown.pose
        self._restart_streams()

    async def run(self) -> None:
        """Open the ports and fly until cancelled; raises `LinkError`."""
        self.open()
        try:
            while True:
                self.step(self._clock.now_ns())
                busy = len(self.companion.ring) or len(self.ground.ring)
                await asyncio.sleep(BUSY_WAKE_S if busy else IDLE_WAKE_S)
        finally:
            self.close()

    def open(self) -> None:
        """Open the ports on the running loop; raises `LinkError`."""
        settings = self._settings
        for side, peer, port in (
            (self.companion, settings.companion, settings.companion_port),
            (self.ground, settings.ground, settings.ground_port),
        ):
            if peer is not None:
                side.port = DatagramPort(peer, port, self._taker(side), self._clock)
                side.port.open()

    def close(self) -> None:
        """Close the UDP ports of both links."""
        for side in (self.companion, self.ground):
            if side.port is not None:
                side.port.close()

    def reboot(self) -> None:
        """Restart the autopilot: streams and boot time are reset, and it is silent at first."""
        now_ns = self._clock.now_ns()
        self._booted_ns = self._silent_until_ns = now_ns + REBOOT_NS
        self._restart_streams()
        self.parameters.restart()
        log.info("simulated autopilot restarts")

    def boot_ns(self, time_ns: int) -> int:
        """Time since boot [ns] at a time in UTC [ns]."""
        elapsed = time_ns - self._booted_ns
        return elapsed + round(elapsed * self._settings.clock_skew_ppm * 1e-6)

    def time_ns(self, boot_ns: int) -> int:
        """UTC time [ns] at which the boot clock shows `boot_ns`."""
        elapsed = boot_ns / (1 + self._settings.clock_skew_ppm * 1e-6)
        return self._booted_ns + round(elapsed)

    def counters(self) -> dict[str, int]:
        """Counts of messages forwarded and lost."""
        return {
            "forwarded_to_ground": self.ground.ring.forwarded,
            "dropped_to_ground": self.ground.ring.dropped,
            "forwarded_to_companion": self.companion.ring.forwarded,
            "dropped_to_companion": self.companion.ring.dropped,
            "lost_ground_link": self.ground.inward.lost + self.ground.outward.lost,
            "lost_companion_link": self.companion.inward.lost + self.companion.outward.lost,
        }

    def step(self, now_ns: int) -> None:
        """Send and forward the messages that are due."""
        if self.flown is not None and self.flown.advance(now_ns):
            # ArduPilot reports a change of mode at once.
            self._heartbeat_ns = self._heartbeat_ns if self._px4 else 0
        if now_ns < self._silent_until_ns:
            return
        self.missions.tick(s_from_ns(now_ns))
        for side in (self.companion, self.ground):
            if side.port is not None:
                self._forward(side, now_ns)
                self._stream(side, now_ns)
        if now_ns - self._heartbeat_ns >= HEARTBEAT_NS:
            self._heartbeat_ns = now_ns
            for side in (self.companion, self.ground):
                self._send(side, self._heartbeat())
        if now_ns - self._timesync_ns >= TIMESYNC_NS[self._settings.flavour]:
            self._timesync_ns = now_ns
            self._send(self.companion, dialect.Timesync(ts1=self.boot_ns(now_ns)))

    def _taker(self, side: _LinkSide) -> Callable[[bytes, int], None]:
        def take(data: bytes, arrival_ns: int) -> None:
            side.parser.reset()
            for frame in side.parser.feed(data):
                release_ns = side.inward.release_ns(arrival_ns)
                if release_ns is not None:
                    self._later(release_ns, partial(self.receive, side, frame, release_ns))

        return take

    def _later(self, time_ns: int, action: Callable[[], None]) -> None:
        wait_s = (time_ns - self._clock.now_ns()) / 1e9
        if wait_s <= 0.0:
            action()
        else:
            asyncio.get_running_loop().call_later(wait_s, action)

    def receive(self, side: _LinkSide, frame: Frame, arrival_ns: int) -> None:
        """Handle a frame from a link: answer it, forward it, or both."""
        if arrival_ns < self._silent_until_ns:
            return
        side.routes.saw(frame)
        message = frame.message()
        system_id = getattr(message, "target_system", 0)
        component_id = getattr(message, "target_component", 0)
        own = (self._settings.system_id, 1)
        if message is not None and system_id in (0, own[0]) and component_id in (0, own[1]):
            self._answer(side, message, frame, arrival_ns)
        other = self.ground if side is self.companion else self.companion
        if other.port is None or (system_id, component_id) == own:
            return
        if isinstance(message, dialect.RadioStatus) and not self._px4:
            return
        if not all(map(self.parameters.passes_on, (COMPANION_PORT, GROUND_PORT))):
            return
        if other.routes.leads_to(system_id, component_id):
            self._forward(other, arrival_ns)
            other.ring.push(frame)

    def _forward(self, side: _LinkSide, now_ns: int) -> None:
        for frame in side.ring.passes(now_ns):
            self._emit(side, frame.raw)

    def _send(self, side: _LinkSide, message: Message) -> None:
        self._emit(side, side.writer.encode(message))

    def _emit(self, side: _LinkSide, frame: bytes) -> None:
        port = side.port
        release_ns = side.outward.release_ns(self._clock.now_ns())
        if port is not None and release_ns is not None:
            self._later(release_ns, lambda: port.send(frame))

    def _stream(self, side: _LinkSide, now_ns: int) -> None:
        boot_ns = self.boot_ns(now_ns)
        for message_id, interval_ns in side.intervals_ns.items():
            due_ns = side.due_ns.setdefault(message_id, boot_ns)
            if boot_ns - due_ns > MAX_LATE_NS:
                due_ns = boot_ns
            while due_ns <= boot_ns:
                time_ns = self.time_ns(due_ns)
                message = self._telemetry(message_id, due_ns // 1_000_000, time_ns)
                if message is not None:
                    self._send(side, message)
                due_ns += interval_ns
            side.due_ns[message_id] = due_ns

    def _telemetry(self, message_id: int, boot_ms: int, time_ns: int) -> Message | None:
        if message_id == dialect.Heartbeat.ID:
            return self._heartbeat()
        if self.flown is not None and message_id in FLOWN_IDS:
            return self.flown.message(message_id, boot_ms)
        return telemetry_message(message_id, self._vehicle(time_ns), boot_ms, time_ns)

    def _answer(self, side: _LinkSide, message: Message, frame: Frame, now_ns: int) -> None:
        sender = Peer(frame.system_id, frame.component_id)
        match message:
            case dialect.Timesync() if message.tc1 == 0 and not self._settings.mute_clock:
                # PX4 1.17 fills in random ids.
                chance = self._random.randrange
                target = Peer(chance(256), chance(256)) if self._px4 else sender
                answer = dialect.Timesync(
                    tc1=self.boot_ns(self._clock.now_ns()), ts1=message.ts1, **target.address
                )
                self._send(side, answer)
            case dialect.Ping() if message.target_system == 0:
                if self._px4:
                    answer_ping = dialect.Ping(
                        time_usec=message.time_usec, seq=message.seq, **sender.address
                    )
                    self._send(side, answer_ping)
            case dialect.ParamRequestList() | dialect.ParamRequestRead() | dialect.ParamSet():
                for value in self.parameters.receive(message):
                    self._send(side, value)
                if self.flown is not None and self._px4:
                    height_m = self.parameters.values["MIS_TAKEOFF_ALT"]
                    self.flown.vehicle.takeoff_height_m = height_m
            case dialect.CommandLong() | dialect.CommandInt():
                if message.target_component == 1:
                    self._command(side, message, sender.place)
            case _:
                send = partial(self._send, side)
                self.missions.receive(message, sender.place, s_from_ns(now_ns), send)

    def _command(
        self,
        side: _LinkSide,
        message: dialect.CommandLong | dialect.CommandInt,
        sender: tuple[int, int],
    ) -> None:
        result: int = MavResult.UNSUPPORTED
        moved = None if self.flown is None else self.flown.vehicle.command(message)
        if moved is not None:
            result = moved
            place = f"{sender[0]}/{sender[1]}"
            log.info("motion", command=message.command, sender=place, change=message.param2)
        match message.command:
            case MavCmd.SET_MESSAGE_INTERVAL:
                result = self._set_interval(side, message.param1, message.param2)
            case MavCmd.REQUEST_MESSAGE if message.param1 in (
                dialect.AutopilotVersion.ID,
                dialect.HomePosition.ID,
                *(() if self.flown is None else (dialect.SysStatus.ID,)),
            ):
                result = MavResult.ACCEPTED
            case MavCmd.PREFLIGHT_REBOOT_SHUTDOWN if message.param1 == 1:
                result = MavResult.ACCEPTED
        ack = dialect.CommandAck(
            command=message.command, result=result, **Peer(*sender).address
        )
        self._send(side, ack)
        if message.command == MavCmd.REQUEST_MESSAGE and result == 0:
            self._send(side, self._fact(int(message.param1)))
        if message.command == MavCmd.PREFLIGHT_REBOOT_SHUTDOWN and result == 0:
            self.reboot()

    def _fact(self, message_id: int) -> Message:
        if message_id == dialect.AutopilotVersion.ID:
            return dialect.AutopilotVersion(
                capabilities=CAPABILITIES,
                flight_custom_version=bytes(8),
                middleware_custom_version=bytes(8),
                os_custom_version=bytes(8),
                uid=self._settings.unique_number,
            )
        if self.flown is not None and message_id == dialect.SysStatus.ID:
            return self.flown.status()
        if self.flown is not None:
            return home_message(self.flown.vehicle)
        home = self._vehicle(self._booted_ns)
        return dialect.HomePosition(
            latitude=round(home.latitude_deg * 1e7),
            longitude=round(home.longitude_deg * 1e7),
            altitude=round(home.altitude_amsl_m * 1e3),
            q=(1.0, 0.0, 0.0, 0.0),
        )

    def _set_interval(self, side: _LinkSide, number: float, interval_us: float) -> MavResult:
        known = set(default_intervals_ns("px4", "companion"))
        if self.flown is not None:
            known |= REQUESTABLE_IDS[self._settings.flavour]
            slowest = SLOWEST_NS[self._settings.flavour].get(int(number), 0)
            interval_us = max(interval_us, slowest / 1e3) if interval_us > 0 else interval_us
        if number not in known or not math.isfinite(interval_us):
            return MavResult.DENIED
        message_id = int(number)
        side.due_ns.pop(message_id, None)
        side.intervals_ns.pop(message_id, None)
        if interval_us == 0:
            interval = default_intervals_ns(self._settings.flavour, side.name).get(message_id)
            if interval is not None:
                side.intervals_ns[message_id] = interval
        elif interval_us > 0:
            side.intervals_ns[message_id] = max(1_000_000, round(interval_us * 1000))
        return MavResult.ACCEPTED

    def _restart_streams(self) -> None:
        for side in (self.companion, self.ground):
            side.intervals_ns = default_intervals_ns(self._settings.flavour, side.name)
            side.due_ns = {}

    def _heartbeat(self) -> dialect.Heartbeat:
        armed, mode = self._settings.armed, 0
        if self.flown is not None:
            armed, mode = self.flown.vehicle.armed, self.flown.vehicle.mode
        return dialect.Heartbeat(
            type=dialect.MavType.QUADROTOR,
            autopilot=dialect.MavAutopilot.PX4
            if self._px4
            else dialect.MavAutopilot.ARDUPILOTMEGA,
            base_mode=dialect.MavModeFlag.CUSTOM_MODE_ENABLED
            | (dialect.MavModeFlag.SAFETY_ARMED if armed else 0),
            custom_mode=mode,
            system_status=dialect.MavState.ACTIVE,
            mavlink_version=3,
        )
