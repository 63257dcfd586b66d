"""Ground station's side of the protocol with the drone, without I/O."""

import itertools
import math
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass

from uavrt.core.commands import CommandId, Generation, SystemState
from uavrt.core.errors import LinkError, TunnelError
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    Beep,
    BurstInside,
    Course,
    LiveBearing,
    PulsePose,
    SearchReport,
    StatusText,
    Tag,
)
from uavrt.core.units import ns_from_s
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT, VehicleIdentity
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import STATION_SYSTEM_ID, Peer, station_heartbeat
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.sending.statustext import TextAssembler
from uavrt.link.tunnel.gate import Sealer
from uavrt.link.tunnel.generations.codec import TunnelMessage, acked_command_of, decode
from uavrt.link.tunnel.generations.g0 import SUCCESS, AckG0, PulseG0
from uavrt.link.tunnel.generations.g1 import STATES, AckG1, Heartbeat, PulseG1
from uavrt.link.tunnel.generations.g2 import (
    AckG2,
    DetectorHeartbeat,
    HeartbeatG2,
    HeartbeatG2v1,
    OperationProgress,
    PulseG2,
    PulseG2v1,
)
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.own_messages.link_messages import FROM_DRONE
from uavrt.link.tunnel.own_messages.motion_messages import MotionState
from uavrt.link.tunnel.own_messages.private import (
    MOTION_STATE_TYPE,
    PROVEN_STATE_TYPE,
    RECEIPT_TYPE,
    SEALED_TYPE,
    SESSION_TYPE,
)
from uavrt.link.tunnel.tunnel_records import has_place, pulse_from_wire, tag_of_number

log = get_logger()

DRONE_SILENCE_NS = ns_from_s(6.0)
"""Time without messages after which the drone counts as lost [ns], as in the original ground
station."""
FILES_NS = ns_from_s(3.0)
"""Time after a file request for which keepalives announce a file transfer [ns]."""
ORDERS = 16
"""Number of recent motion orders that are remembered; answers to older orders are ignored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DroneHeartbeat:
    """Status of the drone side, sent once a second (tunnel heartbeat, G1)."""

    state: SystemState | None
    cpu_temperature_c: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorAlive:
    """Event that the detector of a tag has sent a heartbeat."""

    tag_id: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledged:
    """The drone's answer to a command."""

    command: int
    accepted: bool
    message: str
    request_id: int = 0
    """Request id in the numbered protocol versions; 0 in older ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperationStep:
    """Progress of a command that continues after its acknowledgement (G2)."""

    command: int
    state: int
    """One of `uavrt.link.tunnel.generations.g2.RUNNING`, `COMPLETE` and `FAILED`."""
    step: int
    step_count: int
    message: str


GroundEvent = (
    PulsePose
    | BurstInside
    | LiveBearing
    | Beep
    | SearchReport
    | DetectorAlive
    | DroneHeartbeat
    | StatusText
    | Acknowledged
    | OperationStep
    | MotionState
    | Course
)


class GroundProtocol:
    """Decodes the drone's frames to events, counts them, and encodes messages; no I/O.

    `as_gcs`: use system 255 and type GCS, which the original system's drone side requires.
    """

    def __init__(
        self,
        system_id: int = STATION_SYSTEM_ID,
        component_id: int = 190,
        receipts: Receipts | None = None,
        sealer: Sealer | None = None,
        generation: Generation = "G1",
        *,
        as_gcs: bool = False,
        identity: VehicleIdentity | None = None,
    ) -> None:
        self.identity = VehicleIdentity() if identity is None else identity
        self.own = Peer(system_id, component_id)
        self._as_gcs = as_gcs
        self._sealer = sealer
        self._generation: Generation = generation
        self.receipts = receipts
        self._frame_pulses: list[bytes] = []
        """Pulse payloads of the frame received last."""
        self._uncommitted: dict[bytes, int] = {}
        """Payloads of accepted pulses that may not be on the disk yet, in order. Values: number
        of stored items when the pulse was accepted."""
        self.drone: Peer | None = None
        self.tags: dict[int, Tag] = {}
        """Tags that we uploaded; received pulses get their pulse width from here."""
        self.orders: deque[int] = deque(maxlen=ORDERS)
        """Numbers of the last motion orders; answers to others are ignored."""
        self.counters: Counter[str] = Counter()
        self._heard_ns = 0
        self.files_asked_ns = -FILES_NS
        """Time of the last file request to the drone [ns]."""
        self._texts = TextAssembler()

    def forget(self) -> None:
        """Clear the drone's address; the next drone found on the chosen vehicle is used."""
        self.drone, self._heard_ns = None, 0

    def set_tags(self, tags: Iterable[Tag]) -> None:
        """Set the tags that are stored on the drone."""
        self.tags = {tag.tag_id: tag for tag in tags}

    def present(self, now_ns: int) -> bool:
        """True while messages of the drone side (component 191) arrive."""
        return self.drone is not None and now_ns - self._heard_ns < DRONE_SILENCE_NS

    def heartbeat(self) -> dialect.Heartbeat:
        """Make the heartbeat message of this ground station."""
        return station_heartbeat(as_gcs=self._as_gcs)

    def accepted(self, count: int = 0) -> None:
        """Record that the received pulses were queued for storage as item number `count`."""
        self._uncommitted.update(dict.fromkeys(self._frame_pulses, count))
        self._frame_pulses.clear()

    def stored(self, count: int = 0) -> None:
        """Acknowledge all pulses up to item number `count`, because they are stored on disk."""
        waiting = self._uncommitted.items()
        for payload, _ in list(itertools.takewhile(lambda one: one[1] <= count, waiting)):
            del self._uncommitted[payload]
            if self.receipts is not None:
                self.receipts.stored(payload)

    def receipt(self, now_ns: int) -> dialect.Tunnel | None:
        """Return the receipt that is due; None if none is due, or no drone was found."""
        if self.receipts is None or self.drone is None:
            return None
        if self._sealer is not None and not self._sealer.ready:
            return None
        receipt = self.receipts.next_due(now_ns)
        if receipt is None:
            return None
        return self.tunnel_message(receipt.encode(), RECEIPT_TYPE)

    def tunnel_message(
        self, payload: bytes, payload_type: int = PAYLOAD_TYPE
    ) -> dialect.Tunnel:
        """Make a TUNNEL message to the drone; raises `LinkError` before a drone is found."""
        if self.drone is None:
            raise LinkError(
                "no contact with the drone yet",
                remedy="Check the drone's power and the radio link, and that the autopilot "
                "forwards MAVLink",
            )
        if self._sealer is not None:
            return self._message(self._sealer(payload, payload_type), SEALED_TYPE)
        return self._message(payload, payload_type)

    def sealed_parameter(self, name: str, value: float) -> dialect.Tunnel | None:
        """Encode an authenticated parameter request (NaN: read it); None without a key."""
        if self._sealer is None or self.drone is None:
            return None
        return self._message(self._sealer.parameter(name, value), SEALED_TYPE)

    def _message(self, payload: bytes, payload_type: int) -> dialect.Tunnel:
        assert self.drone is not None
        return dialect.Tunnel(
            **self.drone.address,
            payload_type=payload_type,
            payload_length=len(payload),
            payload=payload,
        )

    def receive(self, frame: Frame, now_ns: int) -> list[GroundEvent]:
        """Handle a frame; return the events that it contains."""
        self._frame_pulses.clear()  # what could not be taken is to come again
        if frame.component_id != DRONE_COMPONENT:
            return []
        peer = Peer(frame.system_id, frame.component_id)
        message = frame.message()
        if isinstance(message, dialect.Heartbeat) and self.identity.heard(
            frame.system_id, now_ns
        ):
            self.drone = peer
        if peer != self.drone or frame.system_id != self.identity.system_id:
            return []
        self._heard_ns = now_ns
        if isinstance(message, dialect.Statustext):
            texts = self._texts.add(peer.place, message)
            return [StatusText(severity=severity, text=text) for severity, text in texts]
        if isinstance(message, dialect.Tunnel) and _is_for(self.own, message):
            return self._tunnel(message.payload_type, message.payload[: message.payload_length])
        return []

    def keepalives(self, links: int, now_ns: int) -> list[dialect.Tunnel]:
        """Return authenticated heartbeats due now, per link in turn; none without a key."""
        if self._sealer is None or self.drone is None:
            return []
        files = now_ns - self.files_asked_ns < FILES_NS
        sealed = self._sealer.keepalives(links, files=files)
        return [self._message(payload, SEALED_TYPE) for payload in sealed]

    def _read(self, payload_type: int, payload: bytes) -> GroundEvent | None:
        """Decode a payload to an event; None if its type is unknown or only used internally."""
        if payload_type == PAYLOAD_TYPE:
            event = self._event(decode(payload, self._generation))
            self.counters["unexpected_payloads"] += event is None
            return event
        if payload_type == SESSION_TYPE and self._sealer is not None:
            assert self.drone is not None
            self._sealer.accept_session(payload, self.drone.place)
            return None
        if payload_type == PROVEN_STATE_TYPE and self._sealer is not None:
            payload = self._sealer.answer(payload, self.orders)
            return FROM_DRONE[MOTION_STATE_TYPE](payload)  # type: ignore[no-any-return]
        reader = FROM_DRONE.get(payload_type)
        event = None if reader is None else reader(payload)
        if isinstance(event, MotionState) and event.request_id and self._sealer is not None:
            self._sealer.refuse_unproven(payload)
        return event

    def _repeated(self, payload: bytes) -> bool:
        """True if a pulse has arrived before; a stored pulse is then acknowledged once more."""
        known = payload in self._uncommitted
        if not known and (self.receipts is None or not self.receipts.seen(payload)):
            return False
        self.counters["repeated_pulses"] += 1
        return True

    def _log_bad(self, event: str, error: TunnelError) -> None:
        count = self.counters["bad_payloads"]
        log.seldom(count, event, reason=error.message, payload=error.payload.hex())

    def _tunnel(self, payload_type: int, payload: bytes) -> list[GroundEvent]:
        plain = payload_type == PAYLOAD_TYPE
        try:
            event = self._read(payload_type, payload)
        except TunnelError as error:
            self.counters["bad_payloads"] += 1
            self._log_bad("bad tunnel payload", error)
            if plain and acked_command_of(payload) == CommandId.PULSE:
                self._frame_pulses.append(payload)  # in the log; again it would be no better
            return []
        if event is None:
            return []
        if isinstance(event, PulsePose | BurstInside):
            if self._repeated(payload):
                return []
            self._frame_pulses.append(payload)
        self.counters[type(event).__name__] += 1
        return [event]

    def _pulse(self, message: PulseG0 | PulseG1) -> GroundEvent:
        tag = tag_of_number(message.tag_id, self.tags)
        pulse = pulse_from_wire(message, tag)
        if pulse is None:
            return self._detector_alive(message.tag_id)
        if isinstance(pulse, PulsePose) and pulse.pose is None and has_place(message):
            self.counters["bad_poses"] += 1  # the pulse is kept without it
        return pulse

    def _detector_alive(self, tag_id: int) -> DetectorAlive:
        tag = tag_of_number(tag_id, self.tags)
        return DetectorAlive(tag_id=tag_id if tag is None else tag.tag_id)

    def _event(self, message: TunnelMessage) -> GroundEvent | None:
        match message:
            case PulseG0() | PulseG1():
                return self._pulse(message)
            case PulseG2v1(pulse=inner) | PulseG2(pulse=inner):
                return self._pulse(inner)
            case DetectorHeartbeat():
                return self._detector_alive(message.tag_id)
            case OperationProgress():
                return OperationStep(
                    command=message.operation,
                    state=message.state,
                    step=message.step,
                    step_count=message.step_count,
                    message=message.message,
                )
            case AckG0() | AckG1() | AckG2():
                return Acknowledged(
                    command=message.acked_command,
                    accepted=message.result == SUCCESS,
                    message="" if isinstance(message, AckG0) else message.message,
                    request_id=message.request_id if isinstance(message, AckG2) else 0,
                )
            case Heartbeat() | HeartbeatG2v1() | HeartbeatG2():
                temperature = message.cpu_temperature_c
                return DroneHeartbeat(
                    state=STATES.get(message.status),
                    cpu_temperature_c=None if math.isnan(temperature) else temperature,
                )
            case _:
                return None


def _is_for(own: Peer, message: dialect.Tunnel) -> bool:
    return message.target_system in (0, own.system_id) and (
        message.target_component in (0, own.component_id)
    )
