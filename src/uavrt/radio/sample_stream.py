"""Read samples from a pipe, as written by a radio's program.

Measured on the reference machine at 24 MB/s: reading blocks of 87 ms from a pipe of 1 MiB with
``readv`` into existing memory costs 0.5 % of a core. Python bytes, threads or asyncio cost up
to three times as much. With a pipe of 1 MiB, the reader may pause for 44 ms before the radio's
program has to wait; with the default pipe of 64 KiB it is 2.7 ms.
"""

import errno
import os
import select
import stat
import struct
from typing import Final

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import FormatError, RadioError, os_errors_as
from uavrt.core.log import get_logger
from uavrt.core.messages import IQBlock
from uavrt.radio.formats import SampleFormat, clean
from uavrt.radio.live_source import LiveSource
from uavrt.radio.timing.sample_placing import HOLD_S

BLOCK_S: Final = 0.0874
"""Approximate length of a sample block [s]; longer blocks add latency, and shorter blocks wake
the program more often."""
_WRITE: Final = 16384
"""Number of samples of which blocks are multiples, as are the writes of radio programs;
airspy_rx writes 65 536 samples at once. So a block ends with a write and needs no extra
read."""
PIPE_BYTES: Final = 1 << 20
"""Largest pipe that Linux allows without privileges [bytes] (/proc/sys/fs/pipe-max-size)."""
_PIPE_SIZES: Final = (PIPE_BYTES, PIPE_BYTES // 2, PIPE_BYTES // 4)

log = get_logger()


def block_length(sample_rate_hz: float, block_s: float = BLOCK_S) -> int:
    """Number of samples in a block of about `block_s`."""
    step = _WRITE if block_s * sample_rate_hz >= 2 * _WRITE else 8
    return max(64, round(block_s * sample_rate_hz / step) * step)


class StreamSource(LiveSource):
    """Reads live samples from a file descriptor; `close` does not close the descriptor."""

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
        """Number of non-finite sample values that were replaced by zero."""
        self.trailing_bytes = 0
        """Number of bytes of an incomplete sample at the end of the stream."""
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
        """Get the next block; None if it is not complete within `timeout_s`.

        A block ends early before samples that may have been lost.
        """
        deadline_s = None if timeout_s is None else monotonic_s() + timeout_s
        self._compact()
        if not self._waiting_since_ns:
            self._waiting_since_ns = self._clock.now_ns()
            self._placer.begin(self._waiting_since_ns)
        while not self._ended and not self._placer.cut and self._wants_more():
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
                self._register(count)
        if self._ended:
            self._check_end()
        return self._block()

    def _make_room(self, samples: int) -> None:
        self._samples, self._raw = self._format.buffers(samples)
        self._bytes = self._raw.data

    def _compact(self) -> None:
        if self._given:
            self._raw[: self._filled - self._given] = self._raw[self._given : self._filled]
            self._filled -= self._given
            self._given = 0

    def _wants_more(self) -> bool:
        """True if the block is not full, or if samples may be lost and this is not decided."""
        if self._filled < self._wanted:
            return self._filled < len(self._bytes)
        if self._placer.settle() or self._placer.cut:
            return False
        if len(self._bytes) == self._wanted:
            held = self._raw[: self._filled].copy()
            self._make_room(
                self._wanted // self._format.bytes_per_sample
                + round(HOLD_S * self.sample_rate_hz)
            )
            self._raw[: self._filled] = held
        return self._filled < len(self._bytes)

    def _register(self, count: int) -> None:
        """Register the arrival of sample bytes, including those that wait in the pipe.

        Bytes that wait in the pipe count as arrived; otherwise a slow reader would look like a
        late radio. A full pipe does not show the sender's rate, because the sender has to wait.
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
        """Stop reading; the descriptor must be closed by the caller that opened it."""
        self._ended = True
        self._filled = self._given = 0

    def _wait(self, timeout_s: float | None) -> bool:
        if timeout_s is None:
            # Blocking read; also waits for a non-blocking descriptor.
            return bool(self._poll.poll()) if not os.get_blocking(self._descriptor) else True
        return bool(self._poll.poll(timeout_s * 1000.0))

    def _reported_lost(self) -> int:
        """Number of newly lost samples reported by the writer; always 0 in this base class."""
        return 0

    def _check_end(self) -> None:
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
            log.warning("incomplete sample at the end ignored", count_bytes=self.trailing_bytes)
        raise EOFError(f"{self.name} has ended")

    def _block(self) -> IQBlock:
        size = self._format.bytes_per_sample
        count = self._filled // size
        first = self._placer.cut
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
    """Enlarge a pipe as far as allowed; return its size [bytes], or 0 if it is not a pipe."""
    import fcntl  # here: recordings are read where there is none

    with os_errors_as(RadioError, f"cannot read descriptor {descriptor}"):
        if not stat.S_ISFIFO(os.fstat(descriptor).st_mode):
            return 0
    for size in _PIPE_SIZES:
        try:
            return fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, size)
        except OSError as error:
            # EPERM: the user's pipes exceed their quota; EBUSY: the pipe holds more data now.
            if error.errno not in (errno.EPERM, errno.EBUSY):
                break
    return fcntl.fcntl(descriptor, fcntl.F_GETPIPE_SZ)


def _waiting_bytes(descriptor: int) -> int:
    import fcntl
    import termios

    try:
        answer = fcntl.ioctl(descriptor, termios.FIONREAD, b"\0\0\0\0")
    except OSError:
        return 0
    return int(struct.unpack("i", answer)[0])
