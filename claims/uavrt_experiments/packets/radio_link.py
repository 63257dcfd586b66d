"""A pair of SiK telemetry radios in virtual time.

Numbers are those of the ArduPilot/SiK firmware with its defaults: serial port at 57 600 baud,
AIR_SPEED 64, no error correction. The radios take turns. In its turn of 114 ms a radio sends
packets of at most 250 bytes, each of whole MAVLink frames, at 144 µs a byte. That makes 3167
B/s each way when both are busy, and twice that when the other has nothing to send. Data from
the serial port while the 1850-byte buffer is full is lost. A lost packet is not repeated.

Nothing here reads a clock: `VirtualTime` runs the events in order, a flight of half an hour in
seconds.
"""

import heapq
import itertools
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s

SERIAL_BYTES_S = 5760.0
"""Rate of the serial port [B/s]: 57 600 baud, ten bits a byte."""
BYTE_NS = 144_000
TURN_BYTES = 750
"""Bytes sent in a turn of 114.2 ms, less synchronization and packet headers: 3167 B/s × 236.8
ms."""
TURN_NS = 118_400_000
"""Duration of a turn [ns], half of the cycle of 236.8 ms."""
YIELD_NS = 4_000_000
"""Duration of a turn without data [ns]: a short packet that gives the turn to the
other radio."""
PACKET_BYTES = 250
BUFFER_BYTES = 1850
STATUS_NS = ns_from_s(1.0)


class VirtualTime:
    """A clock that advances from one event to the next."""

    def __init__(self, start_ns: int = 0) -> None:
        self.now_ns = start_ns
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = itertools.count()

    def at(self, time_ns: int, action: Callable[[], None]) -> None:
        """Call a function at a time, or now if that time has passed."""
        due_ns = max(time_ns, self.now_ns)
        heapq.heappush(self._events, (due_ns, next(self._numbers), action))

    def every(self, period_ns: int, action: Callable[[], None], *, end_ns: int) -> None:
        """Call a function periodically until `end_ns`."""

        def again() -> None:
            action()
            if self.now_ns + period_ns < end_ns:
                self.at(self.now_ns + period_ns, again)

        self.at(self.now_ns + period_ns, again)

    def run_until(self, time_ns: int, stop: Callable[[], bool] = lambda: False) -> None:
        """Run all events up to a time, or until `stop` is true after one."""
        while self._events and self._events[0][0] <= time_ns:
            self.now_ns, _, action = heapq.heappop(self._events)
            action()
            if stop():
                return
        self.now_ns = max(self.now_ns, time_ns)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioLinkSettings:
    """Quality of the radio link."""

    loss: float = 0.0
    """Probability that a packet on the air is lost, in either direction."""
    down_from_s: float | None = None
    """Start of an outage in both directions [s]; None: no outage."""
    down_until_s: float | None = None
    seed: int = 1


@dataclass(slots=True)
class RadioCounters:
    """Counts of the frames given to one radio, carried and lost."""

    given: int = 0
    carried: int = 0
    buffer_full: int = 0
    lost_in_the_air: int = 0


class _Radio:
    """One radio: a serial port and a send buffer."""

    def __init__(self, deliver: Callable[[bytes], None]) -> None:
        self.deliver = deliver
        self.buffer: deque[bytes] = deque()
        self.used = 0
        self.serial_free_ns = 0
        self.counters = RadioCounters()


class RadioLink:
    """Two radios, "air" at the autopilot and "ground" at the laptop.

    `time`: the virtual clock.
    `settings`: loss and outage.
    `to_ground`, `to_air`: called with each frame that arrives.
    """

    def __init__(
        self,
        time: VirtualTime,
        settings: RadioLinkSettings,
        *,
        to_ground: Callable[[bytes], None],
        to_air: Callable[[bytes], None],
    ) -> None:
        self._time = time
        self._settings = settings
        self._random = random.Random(settings.seed)
        self._start_ns = time.now_ns
        self.air = _Radio(to_ground)
        self.ground = _Radio(to_air)
        self._turn = self.air
        self._turning = False

    def send_down(self, frame: bytes) -> None:
        """Send a frame from the autopilot to its radio."""
        self._from_serial(self.air, frame)

    def send_up(self, frame: bytes) -> None:
        """Send a frame from the laptop to its radio."""
        self._from_serial(self.ground, frame)

    @property
    def buffer_free_percent(self) -> int:
        """Free buffer of the radio at the autopilot [%], as RADIO_STATUS.txbuf."""
        return 100 * (BUFFER_BYTES - self.air.used) // BUFFER_BYTES

    @property
    def down(self) -> bool:
        """True during the outage."""
        begin, end = self._settings.down_from_s, self._settings.down_until_s
        if begin is None or end is None:
            return False
        elapsed_s = (self._time.now_ns - self._start_ns) / NANOSECONDS_PER_SECOND
        return begin <= elapsed_s < end

    def _from_serial(self, radio: _Radio, frame: bytes) -> None:
        """Move a frame from the serial port to the buffer after its transmission time."""
        radio.counters.given += 1
        duration_ns = ns_from_s(len(frame) / SERIAL_BYTES_S)
        radio.serial_free_ns = max(radio.serial_free_ns, self._time.now_ns) + duration_ns
        self._time.at(radio.serial_free_ns, lambda: self._buffer(radio, frame))

    def _buffer(self, radio: _Radio, frame: bytes) -> None:
        if radio.used + len(frame) > BUFFER_BYTES:
            radio.counters.buffer_full += 1
            return
        radio.buffer.append(frame)
        radio.used += len(frame)
        if not self._turning:
            self._turning = True
            self._time.at(self._time.now_ns + YIELD_NS, self._take_turn)

    def _take_turn(self) -> None:
        """Send frames for this turn, then start the other radio's turn."""
        radio = self._turn
        self._turn = self.ground if radio is self.air else self.air
        sent = 0
        while radio.buffer and sent + len(radio.buffer[0]) <= TURN_BYTES:
            packet = [self._take(radio)]
            size = len(packet[0])
            while radio.buffer and size + len(radio.buffer[0]) <= PACKET_BYTES:
                packet.append(self._take(radio))
                size += len(packet[-1])
            sent += size
            self._transmit(radio, packet, sent * BYTE_NS)
        if not (self.air.buffer or self.ground.buffer or sent):
            self._turning = False
            return
        used_ns = YIELD_NS + round(sent / TURN_BYTES * (TURN_NS - YIELD_NS))
        self._time.at(self._time.now_ns + used_ns, self._take_turn)

    def _take(self, radio: _Radio) -> bytes:
        frame = radio.buffer.popleft()
        radio.used -= len(frame)
        return frame

    def _transmit(self, radio: _Radio, packet: list[bytes], after_ns: int) -> None:
        if self.down or self._random.random() < self._settings.loss:
            radio.counters.lost_in_the_air += len(packet)
            return
        radio.counters.carried += len(packet)

        def arrive() -> None:
            for frame in packet:
                radio.deliver(frame)

        self._time.at(self._time.now_ns + after_ns, arrive)
