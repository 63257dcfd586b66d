"""Channel samples from the receiver to a detector, as Unix datagrams.

A radio block becomes a block in each channel. The blocks for one detector are sent together, so
that it wakes once or twice for each radio block, not once for each channel. A datagram has 8
bytes, then, in the first of a radio block, the clipped stretches and carriers, then the blocks,
little endian::

    offset  type  field
    0       u16   blocks  in this datagram
    2       u16   more    1: another datagram of the same radio block follows
    4       u16   clipped  stretches in which the radio's converter was at its limits
    6       u16   carriers  strong and steady in the radio's band

    of each stretch:
    0       i64   begin  antenna time [ns, UTC]
    8       i64   end

    of each carrier:
    0       f64   frequency_hz  absolute

    of each block:
    0       u64   sample_index         of the first sample, lost ones counted
    8       i64   time_ns              antenna time of the first sample [ns, UTC]
    16      f64   center_frequency_hz  centre of the channel
    24      f32   sample_rate_hz       of the channel
    28      u16   channel              number from 0
    30      u16   count                of samples
    32            complex64            samples

A socket pair has no queue limit but its send buffer. While a detector stalls or restarts, the
sender keeps up to `BACKLOG_BYTES` of datagrams, then drops the oldest and counts them. The gap
shows in `sample_index`.

Shared memory would save one copy of 4 MB/s, but needs names, an owner and a clean-up after a
killed process. The first channel waits about a millisecond for the last.
"""

import socket
import struct
from collections import deque

import numpy as np

from uavrt.core.messages import ChannelBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND

ENVELOPE = struct.Struct("<HHHH")
HEADER = struct.Struct("<QqdfHH")
STRETCH = struct.Struct("<qq")
CARRIER = struct.Struct("<d")
MAX_STRETCHES = 1024
"""Largest number of clipped time spans in a datagram (16 KiB); a radio block of 87 ms has up to
90."""
BACKLOG_BYTES = 16 * 1024 * 1024
"""Most samples queued for one detector [bytes]; enough for 280 s of one channel."""
MAX_CARRIERS = 8
_CARRIERS_BYTES = MAX_CARRIERS * CARRIER.size
MAX_SAMPLES = 8192
"""Most samples of one channel in a block of a datagram; a longer block is split."""
MAX_DATAGRAM_BYTES = 128 * 1024
"""Largest datagram [bytes], below the default send buffer of 208 KiB."""


class ChannelSender:
    """Sends the sample blocks of several channels to one detector; never blocks."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._sock = sock
        self._parts: list[bytes] = []
        """Headers and samples that the next datagram will contain."""
        self._size = ENVELOPE.size
        self._clipped: tuple[tuple[int, int], ...] = ()
        self._carriers_hz: tuple[float, ...] = ()
        self._last_clipped: tuple[tuple[int, int], ...] = ()
        """Clipped time spans sent last [ns]; all channels of a radio block have the same."""
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self.samples_dropped = 0
        """Number of samples dropped because the detector did not read them in time."""

    def send(self, block: ChannelBlock) -> None:
        """Queue a channel's samples for `flush`; more than `MAX_SAMPLES` are split."""
        if block.clipped_ns is not self._last_clipped:
            self._last_clipped = block.clipped_ns
            self._take_clipped(block.clipped_ns[-MAX_STRETCHES:])
        for start in range(0, len(block.samples), MAX_SAMPLES):
            part = block.samples[start : start + MAX_SAMPLES]
            self._carriers_hz = block.carriers_hz[:MAX_CARRIERS]
            size = HEADER.size + 8 * len(part)
            if self._size + size + _CARRIERS_BYTES > MAX_DATAGRAM_BYTES:
                self._enqueue(more=True)
            header = HEADER.pack(
                block.sample_index + start,
                block.time_ns + round(start * NANOSECONDS_PER_SECOND / block.sample_rate_hz),
                block.center_frequency_hz,
                block.sample_rate_hz,
                block.channel,
                len(part),
            )
            self._parts += (header, np.ascontiguousarray(part, np.complex64).tobytes())
            self._size += size

    def _take_clipped(self, stretches_ns: tuple[tuple[int, int], ...]) -> None:
        """Add clipped time spans to the next datagram, even those of blocks without samples."""
        most = STRETCH.size * MAX_STRETCHES + _CARRIERS_BYTES
        if self._parts and self._size + most > MAX_DATAGRAM_BYTES:
            self._enqueue(more=True)
        kept = (*self._clipped, *stretches_ns)[-MAX_STRETCHES:]
        self._size += STRETCH.size * (len(kept) - len(self._clipped))
        self._clipped = kept

    def _enqueue(self, *, more: bool) -> None:
        """Queue a datagram of the collected blocks; above `BACKLOG_BYTES`, drop the oldest."""
        carriers = [CARRIER.pack(frequency_hz) for frequency_hz in self._carriers_hz]
        self._size += CARRIER.size * len(carriers)
        envelope = ENVELOPE.pack(len(self._parts) // 2, more, len(self._clipped), len(carriers))
        stretches = (STRETCH.pack(*stretch) for stretch in self._clipped)
        self._waiting.append(b"".join((envelope, *stretches, *carriers, *self._parts)))
        self._clipped = ()
        self._waiting_bytes += self._size
        self._parts.clear()
        self._size = ENVELOPE.size
        while self._waiting_bytes > BACKLOG_BYTES:
            dropped = self._waiting.popleft()
            self._waiting_bytes -= len(dropped)
            overhead = _begin(dropped) + ENVELOPE.unpack_from(dropped)[0] * HEADER.size
            self.samples_dropped += (len(dropped) - overhead) // 8

    def flush(self) -> None:
        """Complete the radio block, and send datagrams until the socket's buffer is full."""
        if self._parts:
            self._enqueue(more=False)
        while self._waiting:
            try:
                self._sock.send(self._waiting[0])
            except BlockingIOError:
                return
            except (ConnectionRefusedError, ConnectionResetError, BrokenPipeError):
                return
            self._waiting_bytes -= len(self._waiting.popleft())


class ChannelReceiver:
    """Receives the sample blocks that the receiver process sends to one detector."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._sock = sock
        self._next_index: dict[int, int] = {}
        self.refused = 0
        """Number of received datagrams without valid blocks."""
        self.complete = True
        """True if the last radio block was received in full."""

    def fileno(self) -> int:
        """File descriptor of the socket, for select."""
        return self._sock.fileno()

    def receive(self) -> list[ChannelBlock]:
        """Return the sample blocks of the next valid datagram; empty if none is waiting."""
        while True:
            try:
                datagram = self._sock.recv(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return []
            pieces = _pieces(datagram)
            if not pieces:
                self.refused += 1
                continue
            self.complete = not ENVELOPE.unpack_from(datagram)[1]
            clipped_ns, carriers_hz = _clipped_ns(datagram), _carriers_hz(datagram)
            return [self._block(datagram, at, clipped_ns, carriers_hz) for at in pieces]

    def _block(
        self,
        datagram: bytes,
        at: int,
        clipped_ns: tuple[tuple[int, int], ...],
        carriers_hz: tuple[float, ...],
    ) -> ChannelBlock:
        index, time_ns, center_hz, rate_hz, channel, count = HEADER.unpack_from(datagram, at)
        lost = max(0, index - self._next_index.get(channel, index))
        self._next_index[channel] = index + count
        return ChannelBlock(
            channel=channel,
            center_frequency_hz=center_hz,
            samples=np.frombuffer(datagram, np.complex64, count, at + HEADER.size),
            sample_index=index,
            time_ns=time_ns,
            sample_rate_hz=rate_hz,
            lost_before=lost,
            clipped_ns=clipped_ns,
            carriers_hz=carriers_hz,
        )


def _pieces(datagram: bytes) -> list[int]:
    """Return where each block in a datagram begins [bytes]; empty for an invalid datagram."""
    if len(datagram) < ENVELOPE.size:
        return []
    places = []
    blocks, _, clipped, carriers = ENVELOPE.unpack_from(datagram)
    if clipped > MAX_STRETCHES or carriers > MAX_CARRIERS:
        return []
    at = _begin(datagram)
    for _ in range(blocks):
        if at + HEADER.size > len(datagram):
            return []
        places.append(at)
        at += HEADER.size + 8 * HEADER.unpack_from(datagram, at)[5]
    return places if at == len(datagram) else []


def _begin(datagram: bytes) -> int:
    """Return where the first block of a datagram begins [bytes]."""
    clipped: int
    carriers: int
    _, _, clipped, carriers = ENVELOPE.unpack_from(datagram)
    return ENVELOPE.size + STRETCH.size * clipped + CARRIER.size * carriers


def _carriers_hz(datagram: bytes) -> tuple[float, ...]:
    """Return the frequencies of the steady carriers that a datagram reports [Hz]."""
    carriers = ENVELOPE.unpack_from(datagram)[3]
    end = _begin(datagram)
    return tuple(
        hz for (hz,) in CARRIER.iter_unpack(datagram[end - CARRIER.size * carriers : end])
    )


def _clipped_ns(datagram: bytes) -> tuple[tuple[int, int], ...]:
    """Return the time spans with clipped samples in a datagram, as (start, end) [ns, UTC]."""
    end = ENVELOPE.size + STRETCH.size * ENVELOPE.unpack_from(datagram)[2]
    stretches = datagram[ENVELOPE.size : end]
    return tuple((begin, end) for begin, end in STRETCH.iter_unpack(stretches))
