"""The simulated autopilot with the thesis's load, and with our own sender."""

from dataclasses import dataclass, replace

from uavrt.core.messages import TunnelPayload
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.sending.pacing import PacedQueue, Priority
from uavrt.link.mavlink.sending.rate import LinkRate
from uavrt.simulation.vehicle.forwarding import PASS_NS, ForwardRing
from uavrt_experiments.capacity.thesis import FEW, ODD, RECEIVED, TOLERANCE
from uavrt_experiments.result import Row

PAYLOAD = bytes(range(1, 129))
FRAME = Frame(bytes(145), 385, 1, 191, 0, bytes(133))
START_NS = 10**12


@dataclass(frozen=True, slots=True, kw_only=True)
class CapacityRow:
    """Result of one series of messages through the simulated autopilot."""

    sent: int
    gap_ms: float
    received: int
    dropped_by_autopilot: int
    """Number dropped, by the autopilot's own counter; with `received` it must add up to `sent`.
    """
    thesis: int | None

    @property
    def result(self) -> Row:
        """Table row of the received messages; the thesis's number is the required value."""
        bar: dict[str, float] = {}
        if self.thesis is not None and (self.sent, self.gap_ms) not in ODD:
            near = max(FEW, TOLERANCE * self.sent)
            bar["least"] = max(0, self.thesis - near)
            bar["most"] = min(self.sent, self.thesis + near)
        return Row.counted(
            "capacity",
            "received",
            f"{self.sent} packets, {self.gap_ms:g} ms apart",
            self.received,
            self.sent,
            original=self.thesis,
            note=f"{self.dropped_by_autopilot} dropped by the autopilot",
            **bar,
        )

    @property
    def ours(self) -> Row:
        """Table row of the messages received from our paced sender; all are required."""
        case = f"our sender, {self.result.case}"
        return replace(self.result, case=case, least=self.sent, most=None)


def model_row(count: int, gap_ms: int, pass_ns: int = PASS_NS) -> CapacityRow:
    """Send `count` messages `gap_ms` apart, as the thesis's test program did."""
    ring = ForwardRing(pass_ns=pass_ns)
    received, now_ns = 0, START_NS
    for _ in range(count):
        received += len(ring.passes(now_ns))
        ring.push(FRAME)
        now_ns += gap_ms * 1_000_000
    received += len(ring.passes(now_ns + 10**9))
    return CapacityRow(
        sent=count,
        gap_ms=gap_ms,
        received=received,
        dropped_by_autopilot=ring.dropped,
        thesis=RECEIVED[count][gap_ms] if count in RECEIVED else None,
    )


class _Supply:
    """A message source with `count` messages."""

    def __init__(self, count: int) -> None:
        self._left = count

    def wait_ns(self, now_ns: int) -> int | None:
        return 0 if self._left else None

    def take(self, now_ns: int, rate_bytes_s: float) -> TunnelPayload:
        self._left -= 1
        return TunnelPayload(PAYLOAD, None)


def our_sender_row(count: int, gap_s: float = 0.020, pass_ns: int = PASS_NS) -> CapacityRow:
    """Send `count` messages by our own sender, all queued at once."""
    ring, queue = ForwardRing(pass_ns=pass_ns), PacedQueue(gap_s, LinkRate())
    queue.add_source(_Supply(count), Priority.PULSE)
    received, now_ns = 0, START_NS
    while (wait_ns := queue.wait_ns(now_ns)) is not None:
        now_ns += wait_ns
        if queue.take(now_ns) is not None:
            received += len(ring.passes(now_ns))
            ring.push(FRAME)
    received += len(ring.passes(now_ns + 10**9))
    return CapacityRow(
        sent=count,
        gap_ms=gap_s * 1e3,
        received=received,
        dropped_by_autopilot=ring.dropped,
        thesis=None,
    )
