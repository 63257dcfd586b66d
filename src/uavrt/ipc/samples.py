"""Channel samples from the receiver to a detector, as Unix datagrams.

One datagram carries one block of one channel: a 32-byte header, then complex64 samples, little
endian::

    offset  type  field
    0       u64   sample_index         of the first sample, lost ones counted
    8       i64   time_ns              antenna time of the first sample [ns, UTC]
    16      f64   center_frequency_hz  centre of the channel
    24      f32   sample_rate_hz       of the channel
    28      u16   channel              number from 0
    30      u16   sequence             rises by one with each datagram of this socket

A socket pair has no queue limit but its send buffer. A detector that stalls or restarts is
waited for: up to `BACKLOG_BYTES` the sender keeps the datagrams, then drops the oldest and
counts them; the gap shows in `sequence` and `sample_index`.
"""

import socket
import struct
from collections import deque

import numpy as np

from uavrt.messages import ChannelBlock

HEADER = struct.Struct("<QqdfHH")
BACKLOG_BYTES = 16 * 1024 * 1024
"""Kept for one detector: 16 MiB are 280 s of one channel, 2.8 s of a hundred."""
MAX_SAMPLES = 8192
"""A larger block is cut, so that a datagram stays below the default send buffer of 208 KiB."""


class ChannelSender:
    """Sends the blocks of some channels to one detector; never blocks."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._sock = sock
        self._sequence = 0
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self.samples_dropped = 0
        """Samples given up because the detector did not take them in time."""

    def send(self, block: ChannelBlock) -> None:
        """Send a block, cut into datagrams; what the socket does not take now waits."""
        for start in range(0, len(block.samples), MAX_SAMPLES):
            part = block.samples[start : start + MAX_SAMPLES]
            header = HEADER.pack(
                block.sample_index + start,
                block.time_ns + round(start * 1e9 / block.sample_rate_hz),
                block.center_frequency_hz,
                block.sample_rate_hz,
                block.channel,
                self._sequence & 0xFFFF,
            )
            self._sequence += 1
            self._enqueue(header + np.ascontiguousarray(part, np.complex64).tobytes())
        self.flush()

    def _enqueue(self, datagram: bytes) -> None:
        self._waiting.append(datagram)
        self._waiting_bytes += len(datagram)
        while self._waiting_bytes > BACKLOG_BYTES:
            dropped = self._waiting.popleft()
            self._waiting_bytes -= len(dropped)
            self.samples_dropped += (len(dropped) - HEADER.size) // 8

    def flush(self) -> None:
        """Send what waits, as far as the socket takes it."""
        while self._waiting:
            try:
                self._sock.send(self._waiting[0])
            except BlockingIOError:
                return
            except (ConnectionRefusedError, ConnectionResetError, BrokenPipeError):
                return
            self._waiting_bytes -= len(self._waiting.popleft())


class ChannelReceiver:
    """Receives channel blocks in a detector."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._sock = sock
        self._buffer = bytearray(HEADER.size + 8 * MAX_SAMPLES)
        self._next_index: dict[int, int] = {}
        self.refused = 0
        """Datagrams too short to be a block."""

    def fileno(self) -> int:
        """File descriptor, for select."""
        return self._sock.fileno()

    def receive(self) -> ChannelBlock | None:
        """Get the next block, or None when nothing waits.

        The samples are a copy; `lost_before` counts the samples of this channel that never
        came.
        """
        while True:
            try:
                size = self._sock.recv_into(self._buffer)
            except BlockingIOError:
                return None
            if size > HEADER.size and (size - HEADER.size) % 8 == 0:
                return self._block(size)
            self.refused += 1

    def _block(self, size: int) -> ChannelBlock:
        index, time_ns, center_hz, rate_hz, channel, _ = HEADER.unpack_from(self._buffer)
        count = (size - HEADER.size) // 8
        samples = np.frombuffer(self._buffer, np.complex64, count, HEADER.size).copy()
        lost = max(0, index - self._next_index.get(channel, index))
        self._next_index[channel] = index + count
        return ChannelBlock(
            channel=channel,
            center_frequency_hz=center_hz,
            samples=samples,
            sample_index=index,
            time_ns=time_ns,
            sample_rate_hz=rate_hz,
            lost_before=lost,
        )
