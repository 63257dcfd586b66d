"""Receive the samples of a frequency band as UDP datagrams of any size.

The setup in the original thesis pipes samples through ``airspy_rx | csdr fir_decimate_cc 8 … |
netcat -u localhost 10000``. netcat sends one datagram for each of its reads, so a datagram
often ends within a sample. The original program reads 2039 samples of each datagram and drops
the rest. This module joins the bytes of successive datagrams to complete samples.

The system counts dropped datagrams (SO_RXQ_OVFL). Each of them becomes a gap of the last
datagram's size, so that later samples still begin at the correct byte. If the system does not
count, a step in the arrival times shows a loss, and the exponents of the floats show where
samples begin.
"""

import socket
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.log import get_logger
from uavrt.core.messages import IQBlock
from uavrt.radio.live_source import DatagramSource
from uavrt.radio.sample_stream import BLOCK_S

SAMPLE_BYTES: Final = 8
_LARGEST: Final = 65_536
_SO_RXQ_OVFL: Final = 40
"""Linux socket option that counts dropped datagrams (asm-generic/socket.h); Python's `socket`
module does not define it."""
_COUNT_SPACE: Final = socket.CMSG_SPACE(4)

log = get_logger()


class BandDatagramSource(DatagramSource):
    """Receives complex64 samples at a UDP port, in datagrams of any size; a `SampleSource`.

    `address`: ``udp://localhost:10000``. `start_time_ns`: time of the first sample [ns, UTC];
    times then follow from the nominal rate. Raises `RadioError` if the port is in use,
    `ConfigError` or `FormatError` for an invalid address or rate.
    """

    def __init__(
        self,
        address: str,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        start_time_ns: int | None = None,
    ) -> None:
        # Bursts of datagrams are normal here; a new start would make times step.
        super().__init__(sample_rate_hz, center_frequency_hz, start_time_ns, start_moves=False)
        self.realigned = 0
        """Number of times that the start of a sample was found again after lost bytes."""
        self._clock = Clock.start()
        self._block_bytes = SAMPLE_BYTES * max(64, round(BLOCK_S * sample_rate_hz))
        self._joiner = ByteJoiner()
        self._blocks: list[tuple[NDArray[np.complex64], int]] = []
        self._overflows: dict[socket.socket, int] = {}
        self._listen(address)
        for sock in self._sockets:
            try:
                sock.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
            except OSError:
                log.debug("the system does not count dropped datagrams")

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block of samples; None if none arrive within `timeout_s`.

        The block is shorter than usual if the sender pauses.
        """
        deadline_s = None if timeout_s is None else monotonic_s() + timeout_s
        while True:
            before = self._joiner.filled
            self._receive()
            if self._joiner.filled != before:
                self._placer.arrived(self._joiner.filled // SAMPLE_BYTES, self._clock.now_ns())
            if self._joiner.has_gap or self._joiner.filled >= self._block_bytes:
                return self._block()
            left_s = None if deadline_s is None else deadline_s - monotonic_s()
            if left_s is not None and left_s <= 0.0:
                return self._block() if self._joiner.filled >= SAMPLE_BYTES else None
            self._poll.poll(None if left_s is None else left_s * 1000.0)

    def _receive(self) -> None:
        for sock in self._sockets:
            while self._joiner.filled < self._block_bytes and not self._joiner.has_gap:
                try:
                    payload, ancillary, _, _ = sock.recvmsg(_LARGEST, _COUNT_SPACE)
                except BlockingIOError:
                    break
                lost = 0
                for level, kind, data in ancillary:
                    if (level, kind) == (socket.SOL_SOCKET, _SO_RXQ_OVFL):
                        count = int.from_bytes(data[:4], "little")
                        lost = (count - self._overflows.get(sock, 0)) & 0xFFFF_FFFF
                        self._overflows[sock] = count
                self._joiner.put(payload, lost)

    def _block(self) -> IQBlock:
        samples, lost_before, self.realigned = self._joiner.take()
        self._placer.add_lost(lost_before)
        self._placer.settle()
        return self._placer.place(samples)


class ByteJoiner:
    """Joins received bytes to complex64 samples and stores the position of one gap."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._after: bytes | None = None
        self._lost_bytes = 0
        self._lost_before = 0
        self._last_size = 0
        self._cut = 0
        self._realigned = 0
        self.filled = 0
        """Number of stored bytes of samples before the next gap."""

    @property
    def has_gap(self) -> bool:
        """True if a gap follows the stored bytes; `take` must then be called before `put`."""
        return self._after is not None

    def put(self, payload: bytes, lost: int = 0) -> None:
        """Add a datagram's bytes.

        `lost`: number of datagrams dropped just before this one. Raises `ValueError` if an
        earlier gap has not been taken yet.
        """
        if self.has_gap:
            raise ValueError("the samples before the gap must be read first")
        if lost:
            self._after = payload
            self._lost_bytes = lost * (self._last_size or len(payload))
        else:
            self._append(payload)
        self._last_size = len(payload)

    def take(self) -> tuple[NDArray[np.complex64], int, int]:
        """Get the complete samples before the next gap.

        Returns (samples, lost_before, realigned). `samples`: a copy (n,), with zeros for
        non-finite values. `lost_before`: number of samples lost before these. `realigned`:
        number of realignments so far.
        """
        data = b"".join(self._parts)
        skip = misalignment(data)
        if skip:
            self._realigned += 1
            data = data[skip:]
        whole = len(data) // SAMPLE_BYTES * SAMPLE_BYTES
        rest = data[whole:]
        samples = np.frombuffer(data, "<c8", whole // SAMPLE_BYTES).astype(np.complex64)
        bad = ~np.isfinite(samples)
        if bad.any():
            samples[bad] = 0.0
        lost_before, self._lost_before = self._lost_before, 0
        if self._after is None:
            self._parts = [rest] if rest else []
        else:
            # The sample that the gap cuts is lost as well, with both of its ends. What is left
            # to cut of one that an earlier gap took has been counted with that.
            lost = len(rest) + self._lost_bytes - self._cut
            if lost > 0:
                self._cut = -lost % SAMPLE_BYTES
                self._lost_before = (lost + self._cut) // SAMPLE_BYTES
            else:
                self._cut = -lost
            payload, self._after, self._lost_bytes = self._after, None, 0
            self._parts = []
            self._append(payload)
        self.filled = sum(map(len, self._parts))
        return samples, lost_before, self._realigned

    def _append(self, payload: bytes) -> None:
        kept = payload[self._cut :]
        self._cut = max(0, self._cut - len(payload))
        self._parts.append(kept)
        self.filled += len(kept)


def misalignment(data: bytes) -> int:
    """Number of bytes to skip to reach the start of a float, 0 to 3; 0 if unknown.

    The fourth byte of a little-endian float32 holds the sign and most of the exponent. Without
    the sign bit it is 0x30 to 0x46 for radio samples of 1e-9 to 1e4. At any other alignment,
    most values lie outside this range.
    """
    # 4096 floats are enough; fewer than 64 are too few.
    count = min(len(data) // 4 - 1, 4096)
    if count < 64:
        return 0
    octets = np.frombuffer(data, np.uint8, 4 * count + 4)
    fractions = []
    for skip in range(4):
        high = octets[skip + 3 : skip + 3 + 4 * count : 4] & 0x7F
        fractions.append(float(np.mean((high >= 0x30) & (high <= 0x46))))
    if fractions[0] > 0.5:
        return 0
    best = int(np.argmax(fractions))
    return best if fractions[best] > 0.9 else 0
