"""Drone, autopilot, radios and ground station in virtual time: arrivals and delays.

The real sender (`uavrt.link.tunnel.pulses.reliable`, `uavrt.link.mavlink.sending.pacing`) with
a model of PX4's forwarding and of the radios. It replaces the half-hour flight of `uavrt
experiment packets`; the tests apply their delivery requirements to it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from uavrt.core.messages import TunnelPayload
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.pacing import PacedQueue, Priority
from uavrt.link.tunnel.own_messages.private import RECEIPT_TYPE, Receipt, payload_hash
from uavrt.link.tunnel.pulses.reliable import ReliableSender
from uavrt.simulation.vehicle.forwarding import ForwardRing
from uavrt_experiments.packets.radio_link import (
    STATUS_NS,
    RadioLink,
    RadioLinkSettings,
    VirtualTime,
)

PASS_NS = 8_333_333
"""Time of a pass of PX4's main loop on a link of 1200 B/s (``-r 1200``) [ns]."""
GROUND = (255, 190)
HEARTBEAT_NS = ns_from_s(1.0)
SILENCE_NS = ns_from_s(10.0)
POLL_NS = ns_from_s(0.05)
TELEMETRY_FRAME = bytes(40)


class Acknowledger(Protocol):
    """The ground's half of the acknowledgement, as
    `uavrt.ground.link.delivery_receipts.Receipts`.
    """

    def seen(self, payload: bytes) -> bool:
        """True if a pulse has already been received."""

    def stored(self, payload: bytes) -> None:
        """Record that a pulse is stored."""

    def next_due(self, now_ns: int) -> Receipt | None:
        """Get the receipt that is due; None if none is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSettings:
    """Settings of one run."""

    radio: RadioLinkSettings = field(default_factory=RadioLinkSettings)
    radio_status: bool = True
    """True if the autopilot forwards RADIO_STATUS, as PX4 does and ArduPilot does not."""
    telemetry_bytes_s: float = 1000.0
    """Load of the autopilot's own messages to the ground [B/s]."""
    forwarding: bool = True
    """True: PX4's ring of 583 bytes, one message a pass; False: the autopilot forwards
    everything."""
    gap_s: float = 0.020
    drain_s: float = 600.0
    """Longest run after the last pulse [s]."""
    ground_restart_s: float | None = None
    """Time at which the ground station restarts with an empty store [s]; None: never."""


@dataclass(slots=True)
class TrialResult:
    """Result of one run in virtual time."""

    sent: int
    received: int
    missing: tuple[int, ...]
    """Indexes of the pulses that never arrived, or that the last store does not have."""
    latencies_s: list[float]
    """Time from each received pulse to its first arrival [s]."""
    sends: int
    arrivals: list[tuple[int, int]]
    """Time of arrival [ns] and index of each pulse, in order."""
    forwarding_dropped: int
    buffer_full: int
    lost_in_the_air: int
    most_in_memory: int
    duration_s: float

    def latency_s(self, share: float) -> float:
        """Latency that a given share of the pulses does not exceed [s]."""
        ordered = sorted(self.latencies_s)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


class LinkTrial:
    """One run: pulses at given times from the drone to the ground.

    `times_s`: when each pulse is ready to send [s].
    `settings`: link and autopilot.
    `acknowledger`: makes the ground's half; None for a ground station that does not
    acknowledge.
    """

    def __init__(
        self,
        times_s: Sequence[float],
        settings: TrialSettings,
        acknowledger: Callable[[int], Acknowledger] | None,
    ) -> None:
        self._settings = settings
        self._make_ground = acknowledger
        self.time = VirtualTime(ns_from_s(1000.0))
        self._start_ns = self.time.now_ns
        self._times_ns = [self._start_ns + ns_from_s(t) for t in times_s]
        self._payloads = [_payload(index) for index in range(len(times_s))]
        self._index_of = {payload_hash(p): i for i, p in enumerate(self._payloads)}
        self.sender: ReliableSender[int] = ReliableSender(self._payloads.__getitem__)
        self.queue = PacedQueue(settings.gap_s)
        self.queue.add_source(self.sender, Priority.PULSE)
        self._ring = ForwardRing(pass_ns=PASS_NS)
        self._drone, self._autopilot = FrameWriter(1, 191), FrameWriter(1, 1)
        self._ground_writer = FrameWriter(*GROUND)
        self._down_parser, self._up_parser = FrameParser(), FrameParser()
        self.link = RadioLink(
            self.time, settings.radio, to_ground=self._at_ground, to_air=self._at_air
        )
        self._ground = None if acknowledger is None else acknowledger(1)
        self._station_ns: int | None = None
        self._wake_ns: int | None = None
        self._on_disk: dict[int, set[int]] = {}
        self._recorded: list[int] = []
        self._stored: dict[int, int] = {}
        self._arrivals: list[tuple[int, int]] = []
        self._most = 0

    def run(self) -> TrialResult:
        """Run to the end, in virtual time."""
        settings = self._settings
        last_ns = max(self._times_ns, default=self._start_ns)
        end_ns = last_ns + ns_from_s(settings.drain_s)
        for index, time_ns in enumerate(self._times_ns):
            self.time.at(time_ns, lambda index=index: self._pulse(index))  # type: ignore[misc]
        self.time.every(HEARTBEAT_NS, self._heartbeats, end_ns=end_ns)
        self.time.every(STATUS_NS, self._radio_status, end_ns=end_ns)
        self.time.every(POLL_NS, self._ground_turn, end_ns=end_ns)
        if settings.telemetry_bytes_s > 0:
            period_ns = ns_from_s(len(TELEMETRY_FRAME) / settings.telemetry_bytes_s)
            self.time.every(
                period_ns, lambda: self.link.send_down(TELEMETRY_FRAME), end_ns=end_ns
            )
        if settings.ground_restart_s is not None:
            restart_ns = self._start_ns + ns_from_s(settings.ground_restart_s)
            self.time.at(restart_ns, self._restart_ground)
        self.time.run_until(last_ns)
        patience_ns = ns_from_s(15.0)  # beyond 10 s a silent ground station is given up
        self.time.run_until(end_ns, stop=lambda: self._quiet(last_ns + patience_ns))
        return self._result()

    def _quiet(self, after_ns: int) -> bool:
        return self.time.now_ns > after_ns and len(self._stored) == len(self._payloads)

    def _result(self) -> TrialResult:
        lost = self.link.air.counters
        return TrialResult(
            sent=len(self._payloads),
            received=len(self._stored),
            missing=tuple(i for i in range(len(self._payloads)) if i not in self._stored),
            latencies_s=[
                (at_ns - self._times_ns[index]) / NANOSECONDS_PER_SECOND
                for index, at_ns in self._stored.items()
            ],
            sends=self.sender.first_sends + self.sender.repeats,
            arrivals=self._arrivals,
            forwarding_dropped=self._ring.dropped,
            buffer_full=lost.buffer_full,
            lost_in_the_air=lost.lost_in_the_air,
            most_in_memory=self._most,
            duration_s=(self.time.now_ns - self._start_ns) / NANOSECONDS_PER_SECOND,
        )

    # --------------------------------------------------------------- the drone

    def _pulse(self, index: int) -> None:
        self._recorded.append(index)
        self.sender.pulses.add((2, index), index)
        self._most = max(self._most, len(self.sender.pulses))
        self._pump()

    def _pump(self) -> None:
        """Send messages as allowed; schedule the next call."""
        now_ns = self.time.now_ns
        self._refill()
        present = self._station_ns is not None and now_ns - self._station_ns < SILENCE_NS
        self.sender.station_present(present, now_ns)
        while (item := self.queue.take(now_ns)) is not None:
            assert isinstance(item, TunnelPayload)
            self._forward(self._drone.encode(_tunnel(item.payload, 0, GROUND)))
        wait_ns = self.queue.wait_ns(now_ns)
        if wait_ns is not None and (
            self._wake_ns is None or self._wake_ns > now_ns + wait_ns or self._wake_ns <= now_ns
        ):
            self._wake_ns = now_ns + max(1, wait_ns)
            self.time.at(self._wake_ns, self._pump)

    def _refill(self) -> None:
        """Refill the queue as `uavrt.flight.database.spool` does from the flight's database."""
        store = self.sender.pulses.wanted()
        if store is None:
            return
        self.sender.stores.note_on_disk(store, on_disk=False)
        kept, here = self._on_disk.get(store, set()), self.sender.pulses.keys(store)
        items = [
            ((2, i), i)
            for i in reversed(self._recorded)
            if i not in kept and (2, i) not in here
        ]
        self.sender.pulses.refill(store, items[:512], more=len(items) > 512)

    def _forward(self, raw: bytes) -> None:
        if not self._settings.forwarding:
            self.link.send_down(raw)
            return
        self._pass()
        if self._ring.push(Frame(raw, 385, 1, 191, 0, raw[10:-2])):
            self.time.at(self.time.now_ns + PASS_NS, self._pass)

    def _pass(self) -> None:
        for frame in self._ring.passes(self.time.now_ns):
            self.link.send_down(frame.raw)
        if len(self._ring):
            self.time.at(self.time.now_ns + PASS_NS, self._pass)

    def _radio_status(self) -> None:
        if self._settings.radio_status:
            self.queue.rate.radio_status(self.link.buffer_free_percent, self.time.now_ns)

    def _at_air(self, raw: bytes) -> None:
        for frame in self._up_parser.feed(raw):
            message = frame.message()
            if isinstance(message, dialect.Heartbeat):
                self._station_ns = self.time.now_ns
            elif isinstance(message, dialect.Tunnel) and message.payload_type == RECEIPT_TYPE:
                receipt = Receipt.decode(message.payload[: message.payload_length])
                new = self.sender.receipt(
                    receipt.store, receipt.hashes, GROUND, self.time.now_ns
                )
                kept = self._on_disk.setdefault(receipt.store, set())
                kept.update(index for _, index in new)
                if receipt.hashes:
                    self.queue.rate.acknowledged(
                        self.sender.underway.fresh_trip_s, self.time.now_ns
                    )
        self._pump()

    # -------------------------------------------------------------- the ground

    def _at_ground(self, raw: bytes) -> None:
        if raw is TELEMETRY_FRAME:
            return
        for frame in self._down_parser.feed(raw):
            message = frame.message()
            if isinstance(message, dialect.Tunnel):
                self._received(message.payload[: message.payload_length])

    def _received(self, payload: bytes) -> None:
        index = self._index_of[payload_hash(payload)]
        if self._ground is not None:
            if self._ground.seen(payload):
                return
            self._ground.stored(payload)
        elif index in self._stored:
            return
        self._stored[index] = self.time.now_ns
        self._arrivals.append((self.time.now_ns, index))

    def _ground_turn(self) -> None:
        receipt = None if self._ground is None else self._ground.next_due(self.time.now_ns)
        if receipt is not None:
            message = _tunnel(receipt.encode(), RECEIPT_TYPE, (1, 191))
            self.link.send_up(self._ground_writer.encode(message))

    def _heartbeats(self) -> None:
        self.link.send_up(self._ground_writer.encode(_heartbeat(dialect.MavType.GCS)))
        self.link.send_down(self._autopilot.encode(_heartbeat(dialect.MavType.QUADROTOR)))

    def _restart_ground(self) -> None:
        """Replace the ground station by one with an empty store; only its pulses count as
        received.
        """
        if self._make_ground is not None:
            self._ground = self._make_ground(2)
            self._stored.clear()


def _payload(index: int) -> bytes:
    """A pulse's 120 bytes, all different, with arbitrary content."""
    return (7).to_bytes(4, "little") + index.to_bytes(4, "little") + bytes(range(1, 113))


def _tunnel(payload: bytes, payload_type: int, target: tuple[int, int]) -> Message:
    return dialect.Tunnel(
        target_system=target[0],
        target_component=target[1],
        payload_type=payload_type,
        payload_length=len(payload),
        payload=payload,
    )


def _heartbeat(kind: int) -> Message:
    return dialect.Heartbeat(
        type=kind,
        autopilot=dialect.MavAutopilot.INVALID,
        system_status=dialect.MavState.ACTIVE,
        mavlink_version=3,
    )
