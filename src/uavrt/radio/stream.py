"""Samples from a pipe, as a radio's program writes them.

Measured on the reference machine: ``readv`` into a preallocated block of 87 ms from a pipe of 1
MiB costs 0.5 % of a core at 24 MB/s; Python bytes, threads or asyncio cost up to three times
that. A pipe of 1 MiB gives 44 ms of slack instead of 2.7 ms before the radio's program has to
wait.
"""

import errno
import os
import select
import stat
import struct
from typing import Final

from uavrt.clock import Clock, monotonic_s
from uavrt.errors import FormatError, RadioError, os_errors_as
from uavrt.log import get_logger
from uavrt.messages import IQBlock
from uavrt.radio.formats import SampleFormat, clean
from uavrt.radio.live_source import LiveSource
from uavrt.radio.placing import HOLD_S

BLOCK_S: Final = 0.0874
"""Approximate block length [s]; longer adds latency, shorter adds wake-ups."""
_WRITE: Final = 16384
"""Radio programs write multiples of this many samples (airspy_rx 65 536). A block that is a
multiple, too, needs no extra write: 262 144 at 3 MS/s."""
PIPE_BYTES: Final = 1 << 20
"""Largest pipe that Linux gives without privilege (/proc/sys/fs/pipe-max-size)."""
_PIPE_SIZES: Final = (PIPE_BYTES, PIPE_BYTES // 2, PIPE_BYTES // 4)

log = get_logger()


def block_length(sample_rate_hz: float, block_s: float = BLOCK_S) -> int:
    """Samples in a block of about `block_s`."""
    step = _WRITE if block_s * sample_rate_hz >= 2 * _WRITE else 8
    return max(64, round(block_s * sample_rate_hz / step) * step)


class StreamSource(LiveSource):
    """Samples from a file descriptor, live: stdin, a pipe, a socket.

    `descriptor`: not closed by `close`. `start_time_ns`: time of the first sample [ns, UTC];
    then times follow from the nominal rate alone. `block_s`: length of a block [s]. `name`: for
    errors. Raises `FormatError`: an impossible rate.
    """

    MAY_BE_SLOW = True
    RATE_REMEDY = "Check --sample-rate, and what slows the program before the pipe down"

    def __init__(
        self,
        descriptor: int,
        sample_format: SampleFormat,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        clock: Clock | None = None,
        start_time_ns: int | None = None,
        block_s: float = BLOCK_S,
        name: str = "standard input",
    ) -> None:
        super().__init__(sample_rate_hz, center_frequency_hz, start_time_ns)
        self.name = name
        self.invalid_values = 0
        """Non-finite values that were replaced by zero."""
        self.trailing_bytes = 0
        """Bytes of an incomplete sample at the end of the stream."""
        self._descriptor = descriptor
        self._format = sample_format
        self._clock = Clock.start() if clock is None else clock
        samples = block_length(sample_rate_hz, block_s)
        self._wanted = samples * sample_format.bytes_per_sample
        self._make_room(samples)
        self._filled = 0
        self._given = 0
        self._ended = False
        self._waiting_since_ns = 0
        self._pipe_bytes = _enlarge_pipe(descriptor)
        self._placer.paced = not stat.S_ISREG(os.fstat(descriptor).st_mode)
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block, cut where a gap may lie before a late arrival."""
        deadline_s = None if timeout_s is None else monotonic_s() + timeout_s
        self._forget_given()
        if not self._waiting_since_ns:
            self._waiting_since_ns = self._clock.now_ns()
            self._placer.begin(self._waiting_since_ns)
        while not self._ended and not self._placer.to_give_first and self._wants_more():
            left_s = None if deadline_s is None else deadline_s - monotonic_s()
            if left_s is not None and left_s < 0.0:
                return None
            if not self._wait(left_s):
                continue
            try:
                count = os.readv(self._descriptor, [self._bytes[self._filled :]])
            except BlockingIOError:
                continue
            except OSError as error:
                raise RadioError(f"cannot read {self.name}: {error.strerror}") from error
            self._ended = count == 0
            if count:
                self._take_in(count)
        if self._ended:
            self._check_end()
        return self._block()

    def _make_room(self, samples: int) -> None:
        """Make room for this many samples, discarding those held."""
        self._samples, self._raw = self._format.buffers(samples)
        self._bytes = self._raw.data

    def _forget_given(self) -> None:
        """Move the remaining samples to the front."""
        if self._given:
            self._raw[: self._filled - self._given] = self._raw[self._given : self._filled]
            self._filled -= self._given
            self._given = 0

    def _wants_more(self) -> bool:
        """Whether to read on: the block is not full, or its place is in question."""
        if self._filled < self._wanted:
            return self._filled < len(self._bytes)
        if self._placer.settle() or self._placer.to_give_first:
            return False
        if len(self._bytes) == self._wanted:
            held = self._raw[: self._filled].copy()
            self._make_room(
                self._wanted // self._format.bytes_per_sample + round(HOLD_S * self._rate_hz)
            )
            self._raw[: self._filled] = held
        return self._filled < len(self._bytes)

    def _take_in(self, count: int) -> None:
        """Note that bytes have arrived.

        Bytes waiting in the pipe count as arrived, so that a slow reader does not look like a
        late radio. A full pipe shows nothing: the writer is waiting for us.
        """
        size = self._format.bytes_per_sample
        lost = self._reported_lost()
        if lost:
            self._placer.add_lost(lost)
        self._filled += count
        waiting = _waiting_bytes(self._descriptor)
        nearly = self._pipe_bytes - min(PIPE_BYTES // 8, self._pipe_bytes // 2)
        full = 0 < nearly < max(waiting, count)
        self._placer.arrived((self._filled + waiting) // size, self._clock.now_ns(), full=full)

    def close(self) -> None:
        """Drop the descriptor; its opener closes it."""
        self._ended = True
        self._filled = self._given = 0

    def _wait(self, timeout_s: float | None) -> bool:
        """Wait for bytes or the end; a hook for subclasses that watch more."""
        if timeout_s is None:
            # Blocking read; also waits for a non-blocking descriptor.
            return bool(self._poll.poll()) if not os.get_blocking(self._descriptor) else True
        return bool(self._poll.poll(timeout_s * 1000.0))

    def _reported_lost(self) -> int:
        """Lost samples that the writer itself reports; a hook."""
        return 0

    def _check_end(self) -> None:
        """Raise the error for the end of the stream, once all samples are given."""
        whole = self._filled // self._format.bytes_per_sample
        if whole > 0:
            return
        self.trailing_bytes, self._filled = self._filled, 0
        if self._placer.index == 0:
            raise FormatError(
                f"no samples came from {self.name}",
                remedy="Check that the program before the pipe runs and writes to its stdout",
            )
        if self.trailing_bytes:
            log.warning("incomplete sample at the end", count_bytes=self.trailing_bytes)
        raise EOFError(f"{self.name} has ended")

    def _block(self) -> IQBlock:
        """Make a block of the bytes here, or of those before a gap."""
        size = self._format.bytes_per_sample
        count = self._filled // size
        first = self._placer.to_give_first
        if 0 < first < count:
            count = first
        samples = self._samples[:count]
        if not self._format.in_place:
            self._format.convert(self._raw[: count * size], samples)
        if self._format.dtype.kind == "f" and self._placer.index == 0:
            # Check once that it is float: every block would cost 0.2 % of a core; a lone NaN
            # later passes through the (finite) filters and is stopped before the detectors.
            self.invalid_values += clean(samples, self.name)
        self._given = count * size
        return self._placer.place(samples)


def _enlarge_pipe(descriptor: int) -> int:
    """Make a pipe as large as allowed; return its size, 0 if it is none."""
    import fcntl  # here: recordings are read where there is none

    with os_errors_as(RadioError, f"cannot read descriptor {descriptor}"):
        if not stat.S_ISFIFO(os.fstat(descriptor).st_mode):
            return 0
    for size in _PIPE_SIZES:
        try:
            return fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, size)
        except OSError as error:
            # EPERM: the user's pipes have used up their share; EBUSY: it holds more now.
            if error.errno not in (errno.EPERM, errno.EBUSY):
                break
    return fcntl.fcntl(descriptor, fcntl.F_GETPIPE_SZ)


def _waiting_bytes(descriptor: int) -> int:
    """Number of bytes that can be read at once."""
    import fcntl
    import termios

    try:
        answer = fcntl.ioctl(descriptor, termios.FIONREAD, b"\0\0\0\0")
    except OSError:
        return 0
    return int(struct.unpack("i", answer)[0])
