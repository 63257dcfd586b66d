"""Estimate how many bytes a second the link to the ground can carry; no I/O.

A token bucket whose rate follows the known state of the link:

- RADIO_STATUS (PX4 passes it on) gives the free part of the radio's buffer.
- Without it (ArduPilot does not forward it), the round trips of acknowledgements do. While the
  mean round trip stays near its minimum the link is not full, and the rate grows. When a queue
  makes it longer, the rate falls. Loss is ignored: on a radio, most is noise.
- With neither, the rate is a planning figure.

Urgent messages (acknowledgements, status) do not wait for the bucket but empty it.
"""

from collections import deque
from dataclasses import dataclass

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s

START_BYTES_S = 1200.0
LEAST_BYTES_S = 300.0
MOST_BYTES_S = 3000.0
"""Highest send rate that RADIO_STATUS can set [bytes/s]; a SiK radio at AIR_SPEED 64 transmits
3167 bytes/s."""
MOST_BY_ACKS_BYTES_S = 24_000.0
PLAIN_BYTES_S = 2000.0
"""Send rate while neither RADIO_STATUS nor acknowledgements arrive [bytes/s]. A SiK radio at
AIR_SPEED 64 transmits 3000, and telemetry uses 1000 of them."""
FRAME_OVERHEAD = 17
"""Number of bytes that a TUNNEL frame adds to its payload: 12 of MAVLink 2 and 5 of TUNNEL."""
BURST_BYTES = 300.0
DEBT_BYTES = 1000.0
PULSE_WAIT_S = 0.005
"""Accepted delay of a pulse by other messages [s]; timers are not more precise than this."""
RADIO_FRESH_NS = ns_from_s(5.0)
ACKS_FRESH_NS = ns_from_s(30.0)
ROUND_NS = ns_from_s(0.25)
BASE_WINDOW = 240
"""Number of 0.25 s rounds (one minute) over which the smallest mean round trip counts as that
of an empty queue."""
QUEUE_GROW_S = 0.15
QUEUE_SHRINK_S = 0.35
"""Queueing delay above which the send rate is lowered [s]. A SiK radio buffers 1850 bytes, or
0.6 s."""
MEAN_WEIGHT = 0.1
QUICK_GROWTH = 1.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """Range of send rates of one kind of link: initial, lowest and highest rate [bytes/s]."""

    start: float = START_BYTES_S
    least: float = LEAST_BYTES_S
    most: float = MOST_BY_ACKS_BYTES_S
    plain: float = PLAIN_BYTES_S
    """Send rate while neither RADIO_STATUS nor acknowledgements arrive [bytes/s]."""


RADIO = Reach()
DIRECT_LINK = Reach(start=60_000.0, least=2_000.0, most=1_000_000.0, plain=30_000.0)
"""Send rates over Wi-Fi or cable [bytes/s]; even 1 Mbit/s Wi-Fi carries 100 kB/s."""


class LinkRate:
    """Token bucket that limits the bytes sent; its rate adapts within the range `reach`."""

    def __init__(self, reach: Reach = RADIO) -> None:
        self._reach = reach
        self._rate = reach.start
        self._tokens = BURST_BYTES
        self._filled_ns: int | None = None
        self._radio_ns: int | None = None
        self._acks_ns: int | None = None
        self._mean_s: float | None = None
        self._means: deque[float] = deque(maxlen=BASE_WINDOW)
        self._round_ns = 0
        self._held_back = False
        self._quick = True
        """True until a queueing delay is measured; the send rate grows fast meanwhile."""

    def bytes_s(self, now_ns: int) -> float:
        """Present limit of the send rate [bytes/s]."""
        if self._fresh(self._radio_ns, RADIO_FRESH_NS, now_ns):
            return min(self._rate, MOST_BYTES_S)
        if self._fresh(self._acks_ns, ACKS_FRESH_NS, now_ns):
            return self._rate
        return self._reach.plain

    def radio_status(self, free_percent: int, now_ns: int) -> None:
        """Adapt the send rate to the free space in the radio's send buffer (RADIO_STATUS)."""
        self._radio_ns = now_ns
        if free_percent < 20:
            self._rate *= 0.6
        elif free_percent < 50:
            self._rate *= 0.85
        elif free_percent > 90:
            self._rate *= 1.05
        self._rate = min(MOST_BYTES_S, max(self._reach.least, self._rate))

    def acknowledged(self, trip_s: float | None, now_ns: int) -> None:
        """Adapt the send rate to an acknowledgement.

        `trip_s`: round trip time of a message that was sent once; None if it was repeated.
        """
        self._acks_ns = now_ns
        if trip_s is None:
            return
        if self._mean_s is None:
            self._mean_s = trip_s
        self._mean_s += MEAN_WEIGHT * (trip_s - self._mean_s)
        if now_ns - self._round_ns < max(ROUND_NS, ns_from_s(self._mean_s / 2)):
            return
        self._round_ns = now_ns
        self._means.append(self._mean_s)
        if not self._fresh(self._radio_ns, RADIO_FRESH_NS, now_ns):
            self._follow_queue(self._mean_s - min(self._means))

    def _follow_queue(self, queue_s: float) -> None:
        if queue_s > QUEUE_SHRINK_S:
            self._rate *= 0.9
            self._quick = False
        elif queue_s >= QUEUE_GROW_S:
            self._quick = False
        elif self._held_back:
            self._rate *= QUICK_GROWTH if self._quick else 1.05
        self._held_back = False
        self._rate = min(self._reach.most, max(self._reach.least, self._rate))

    def wait_ns(self, now_ns: int, room_bytes: float = 0.0) -> int:
        """Time until a message that is not urgent may be sent and a pulse can still follow
        [ns].
        """
        self._fill(now_ns)
        rate = self.bytes_s(now_ns)
        lacking = max(0.0, room_bytes - PULSE_WAIT_S * rate) - self._tokens
        if lacking <= 0.0:
            return 0
        self._held_back = True
        return ns_from_s(lacking / rate) + 1

    def spend(self, size: int, now_ns: int) -> None:
        """Take the `size` bytes of a sent frame from the bucket."""
        self._fill(now_ns)
        self._tokens = max(-DEBT_BYTES, self._tokens - size)

    def _fill(self, now_ns: int) -> None:
        if self._filled_ns is not None:
            elapsed_s = (now_ns - self._filled_ns) / NANOSECONDS_PER_SECOND
            self._tokens = min(BURST_BYTES, self._tokens + elapsed_s * self.bytes_s(now_ns))
        self._filled_ns = now_ns

    @staticmethod
    def _fresh(heard_ns: int | None, limit_ns: int, now_ns: int) -> bool:
        return heard_ns is not None and now_ns - heard_ns < limit_ns
