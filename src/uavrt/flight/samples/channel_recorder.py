"""Record the tags' radio channels as SigMF; detection and other recording have priority.

`put` only queues blocks. A thread writes each channel to a series of files, so that the oldest
can be removed (`uavrt.flight.samples.channel_budget`). Samples that a slow or full disk cannot
accept are dropped, counted and marked as a gap.

The noise at the start of a file determines its scale. In an 8-bit file the noise has at least 3
quantization steps, so rounding adds 0.02 to 0.04 dB of noise. Signals of up to 26 dB above the
noise fit, which is 48 dB in the energy of a pulse of 20 ms. A stronger signal begins a new file
of 16 bits, in which the noise has 20 to 40 steps and signals of 58 dB fit. For a still stronger
signal the scale is widened. So nothing is clipped, and rounding adds less than 0.05 dB for
signals of up to 73 dB. If the noise falls, a new 8-bit file begins before the noise has fewer
than 2 steps.
"""

import math
import threading
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.core.clock import monotonic_s
from uavrt.core.log import get_logger
from uavrt.core.messages import ChannelBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.dsp.zero_runs import zero_runs
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.samples.channel_budget import ChannelBudget
from uavrt.flight.samples.sample_file import BYTES_PER_SAMPLE, FreeSpace, SampleFile
from uavrt.flight.samples.sigmf_metadata import FULL_SCALE

log = get_logger()

FLUSH_S = 2.0
"""Time between two writes of samples to the disk [s]; a power cut loses at most this time."""
MOST_WAITING_BYTES = 16 * 1024 * 1024
"""Maximum size of the samples that wait for the disk [bytes]: 280 s of one channel."""
SLOW_S, REST_S = 1.0, 10.0
"""Duration of a write above which writing pauses, and length of the pause [s]."""
PIECE_S, SHORTEST_PIECE_S = 300.0, 5.0
PIECES_OF_BUDGET = 8
"""Minimum number of files into which the disk space of each channel is divided."""
FREE_SPACE_FACTOR = 1.2
"""Ratio of the free disk space that channel recording requires to that which other recording
requires. Channel recording stops first, so that it never causes flights to be removed."""
NOISE_STEPS = {8: 3.0, 16: 20.0}
"""Minimum rms of the noise's I and Q at the start of a file [quantizer steps], for each number
of bits per value."""
FINER = math.sqrt(0.5)
"""Fraction to which the noise amplitude must fall from its value at the file's start before an
8-bit file ends."""
WINDOW = 128
HEADROOM = 1.25
"""Minimum ratio of a file's full scale to the peak of the strong signal for which the scale was
widened."""
WIDER_S = 20.0
"""Minimum duration of a 16-bit file [s] before a smaller scale may be used again."""
TIME_STEP_NS = 500_000
"""Clock step above which a new stretch of samples begins in the metadata [ns]."""
GAP_S = 0.05
"""Shortest run of zero samples that is stored as a gap [s]; zeros replace lost samples."""


@dataclass(frozen=True, slots=True)
class _Batch:
    """Samples of all recorded channels from one block of the radio, with their start time."""

    channels: tuple[tuple[int, float], ...]
    """Number and centre frequency [Hz] of each channel."""
    samples: NDArray[np.complex64]
    """(channels, n) complex samples, one row for each of `channels`."""
    sample_index: int
    time_ns: int
    sample_rate_hz: float

    @property
    def end_ns(self) -> int:
        """Time just after the last sample [ns]."""
        lasts_s: float = self.samples.shape[1] / self.sample_rate_hz
        return self.time_ns + round(lasts_s * NANOSECONDS_PER_SECOND)

    def continued_by(self, later: "_Batch") -> bool:
        """True if another batch follows this one without missing samples or a clock step."""
        return (
            later.channels == self.channels
            and later.sample_index == self.sample_index + self.samples.shape[1]
            and abs(later.time_ns - self.end_ns) < TIME_STEP_NS
        )


@dataclass(slots=True)
class _Channel:
    """A recorded radio channel and the file to which it is being written."""

    center_frequency_hz: float
    sample_rate_hz: float
    number: int = 0
    file: SampleFile | None = None
    widened: bool = False
    """True if the file's full scale is wider than its noise requires."""


class ChannelRecorder:
    """Writes channels to files ``channel_148124375_Hz_0001.sigmf-data`` and ``-meta``.

    Nothing is written while the disk has less free space than `FREE_SPACE_FACTOR` times
    `minimum_free_mb`.
    """

    def __init__(
        self,
        flight: Path,
        *,
        budget_mb: float = 2000.0,
        minimum_free_mb: float = 500.0,
        hardware: str = "",
    ) -> None:
        self._directory = FlightLayout(flight).channels_directory
        self._budget = ChannelBudget(flight, budget_mb * 1e6)
        self._budget_bytes = budget_mb * 1e6
        self._space = FreeSpace(flight, minimum_free_mb * FREE_SPACE_FACTOR)
        self._hardware = hardware
        self._channels: dict[int, _Channel] = {}
        self._batches: list[_Batch] = []
        self._waiting_bytes = 0
        self._piece_s = PIECE_S
        self._last: _Batch | None = None
        """Last batch of samples written to the files; None before the first one."""
        self._rest_until_s = float("-inf")
        self._overflowing = False
        self._condition = threading.Condition()
        self._closing = False
        self.written_samples = 0
        self.dropped_samples = 0
        """Number of samples dropped because the disk was slow, full or failing."""
        self.invalid_values = 0
        """Number of non-finite sample values, which are stored as zeros."""
        self.trouble: str | None = None
        """Reason why nothing is recorded at present; None while recording."""
        self._thread = threading.Thread(target=self._run, name="channel-recorder", daemon=True)
        self._thread.start()

    @property
    def removed_pieces(self) -> int:
        """Number of old files removed to stay within the budget."""
        return self._budget.removed_pieces

    @property
    def kept_mb(self) -> float:
        """Size of the recorded channels of all flights [MB]."""
        return self._budget.bytes / 1e6

    def put(self, blocks: list[ChannelBlock]) -> None:
        """Queue a copy of a radio block's channels without waiting; a full queue drops it.

        After an overflow, blocks are dropped until half of the queue is written. This causes
        few long gaps and not many short ones.
        """
        first = blocks[0]
        batch = _Batch(
            channels=tuple((block.channel, block.center_frequency_hz) for block in blocks),
            samples=np.stack([block.samples for block in blocks]),
            sample_index=first.sample_index,
            time_ns=first.time_ns,
            sample_rate_hz=first.sample_rate_hz,
        )
        size = batch.samples.nbytes
        with self._condition:
            if self._overflowing and self._waiting_bytes <= MOST_WAITING_BYTES // 2:
                self._overflowing = False
            if self._waiting_bytes + size > MOST_WAITING_BYTES and self._waiting_bytes:
                self._overflowing = True
                self.trouble = "the disk is slow"
            if self._overflowing or self._closing or monotonic_s() < self._rest_until_s:
                self.dropped_samples += batch.samples.size
                return
            self._batches.append(batch)
            self._waiting_bytes += size
            if self._waiting_bytes > MOST_WAITING_BYTES // 4:
                self._condition.notify()

    def close(self, timeout_s: float = 5.0) -> None:
        """Write the queued blocks for at most `timeout_s`, and stop; may be called again."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        self._thread.join(timeout_s)

    # ------------------------------------------------------------------ the thread

    def _run(self) -> None:
        try:
            self._budget.find_files()
            last = False
            while not last:
                with self._condition:
                    self._condition.wait_for(self._worth_writing, FLUSH_S)
                    last = self._closing
                began_s = monotonic_s()
                self._flush()
                if monotonic_s() - began_s > SLOW_S and not last:
                    self.trouble = "the disk is slow"
                    self._rest_until_s = monotonic_s() + REST_S
        except Exception as error:
            log.exception("recording of channel samples stopped; detection goes on")
            self.trouble = str(error) or type(error).__name__
            with self._condition:
                self._closing = True
                self.dropped_samples += self._waiting_bytes // 8
                self._waiting_bytes = 0
        finally:
            for channel in self._channels.values():
                self._end_piece(channel)

    def _worth_writing(self) -> bool:
        return self._closing or self._waiting_bytes > MOST_WAITING_BYTES // 4

    def _flush(self) -> None:
        with self._condition:
            batches, self._batches = self._batches, []
        for run in _runs(batches):
            samples = np.concatenate([batch.samples for batch in run], axis=1)
            self._write(run[0], samples)
            self._last = run[-1]
            with self._condition:
                self._waiting_bytes -= samples.nbytes

    def _write(self, first: _Batch, samples: NDArray[np.complex64]) -> None:
        """Write each channel's samples of consecutive batches."""
        if not self._space.enough():
            self._drop(samples.size, "the disk is nearly full")
            return
        size = samples.shape[1] * sum(self._bytes(number) for number, _ in first.channels)
        if not self._budget.make_room(size):
            self._drop(samples.size, "channels_mb is used up")
            for channel in self._channels.values():
                self._end_piece(channel)  # the next ones take their place
            return
        values = samples.view(np.float32)
        peaks = np.maximum(values.max(axis=1), -values.min(axis=1))
        if not np.isfinite(peaks).all():
            bad = ~np.isfinite(samples)
            self.invalid_values += int(np.count_nonzero(bad))
            samples = np.where(bad, np.complex64(0.0), samples)
            peaks = np.abs(samples.view(np.float32)).max(axis=1)
        self._piece_s = self._length_of_pieces(len(samples) * first.sample_rate_hz)
        # Samples are lost in all channels at once.
        stretches = _without_gaps(samples[0], round(GAP_S * first.sample_rate_hz))
        if not stretches:
            self._budget.return_bytes(size)
            return
        moved = self._last is None or not self._last.continued_by(first)
        written = written_bytes = 0
        fault = None
        for (number, center_hz), row, peak in zip(first.channels, samples, peaks, strict=True):
            channel = self._channels.setdefault(
                number, _Channel(center_hz, first.sample_rate_hz)
            )
            try:
                file = self._file_for(channel, row, float(peak))
                if moved:
                    file.break_off()
                appended = _append(file, row, first, stretches)
                written += appended
                written_bytes += appended * file.bytes_per_sample
            except OSError as error:
                fault = error.strerror or str(error)
        self._budget.return_bytes(size - written_bytes)
        self.written_samples += written
        if fault is None:
            self.trouble = None
        else:
            left = len(first.channels) * sum(end - begin for begin, end in stretches)
            self._drop(left - written, fault)

    def _bytes(self, number: int) -> int:
        """Bytes per complex sample in the channel's present file; 2 before its first file."""
        channel = self._channels.get(number)
        if channel is None or channel.file is None:
            return BYTES_PER_SAMPLE // 2
        return channel.file.bytes_per_sample

    def _drop(self, samples: int, why: str) -> None:
        with self._condition:
            self.dropped_samples += samples
        if why != self.trouble:
            log.warning("channel samples not recorded; detection goes on", reason=why)
        self.trouble = why
        for channel in self._channels.values():
            if channel.file is not None:
                channel.file.break_off()

    def _file_for(
        self, channel: _Channel, samples: NDArray[np.complex64], peak: float
    ) -> SampleFile:
        """File for the next samples; a new one if the present file is long or badly scaled."""
        if channel.file is not None and self._is_over(channel, channel.file, samples, peak):
            self._end_piece(channel)
        if channel.file is None:
            bits, scale, channel.widened = _scale_of_piece(samples, peak)
            channel.file = SampleFile(
                self._next_name(channel),
                sample_rate_hz=channel.sample_rate_hz,
                center_frequency_hz=channel.center_frequency_hz,
                description="Channel of a tag, recorded during detection",
                hardware=self._hardware,
                full_scale=scale,
                sync=False,
                bits=bits,
            )
        return channel.file

    def _is_over(
        self, channel: _Channel, file: SampleFile, samples: NDArray[np.complex64], peak: float
    ) -> bool:
        """True if the channel's file must end and the next samples need a new file."""
        length_s = file.written_samples / channel.sample_rate_hz
        if _needed(peak, file.bits) > file.full_scale or length_s >= self._piece_s:
            return True
        if file.bits == 8:
            fitting = _scale_by_noise(samples, 8)
            return length_s >= SHORTEST_PIECE_S and 0.0 < fitting < FINER * file.full_scale
        if length_s < WIDER_S:
            return False
        bits, scale, _ = _scale_of_piece(samples, HEADROOM * peak)
        return bits == 8 or (channel.widened and file.full_scale > 4.0 * scale)

    def _length_of_pieces(self, rate_hz: float) -> float:
        """Duration of one file [s], such that several files of each channel fit the budget."""
        share_s = self._budget_bytes / (rate_hz * BYTES_PER_SAMPLE) / PIECES_OF_BUDGET
        return min(PIECE_S, max(SHORTEST_PIECE_S, share_s))

    def _next_name(self, channel: _Channel) -> Path:
        """Name of a new file, with a number above all existing ones, also after a restart."""
        name = f"channel_{channel.center_frequency_hz:.0f}_Hz_"
        if channel.number == 0:
            there = self._directory.glob(f"{name}*.sigmf-data")
            numbers = [path.stem.removeprefix(name) for path in there]
            channel.number = max((int(one) for one in numbers if one.isdecimal()), default=0)
        channel.number += 1
        return self._directory / f"{name}{channel.number:04d}"

    def _end_piece(self, channel: _Channel) -> None:
        if channel.file is not None:
            channel.file.close()
            size = channel.file.written_samples * channel.file.bytes_per_sample
            self._budget.closed(channel.file.data_path, size)
            channel.file = None


def _append(
    file: SampleFile,
    samples: NDArray[np.complex64],
    first: _Batch,
    stretches: list[tuple[int, int]],
) -> int:
    """Write samples of a channel as consecutive stretches; return the number of samples."""
    for begin, end in stretches:
        later_ns = round(begin / first.sample_rate_hz * NANOSECONDS_PER_SECOND)
        file.append(samples[begin:end], first.sample_index + begin, first.time_ns + later_ns)
    return sum(end - begin for begin, end in stretches)


def _runs(batches: list[_Batch]) -> list[list[_Batch]]:
    """Split batches where samples are missing or the clock steps."""
    runs = [[batch] for batch in batches[:1]]
    for before, batch in pairwise(batches):
        if before.continued_by(batch):
            runs[-1].append(batch)
        else:
            runs.append([batch])
    return runs


def _without_gaps(samples: NDArray[np.complex64], shortest: int) -> list[tuple[int, int]]:
    """Split samples at runs of at least `shortest` zeros, which replace lost samples."""
    stretches, begin = [], 0
    for low, high in zero_runs(samples, shortest):
        stretches.append((begin, low))
        begin = high
    stretches.append((begin, len(samples)))
    return [(low, high) for low, high in stretches if high > low]


def _needed(peak: float, bits: int) -> float:
    return peak * FULL_SCALE[bits] / (FULL_SCALE[bits] - 1.0)


def _scale_of_piece(samples: NDArray[np.complex64], peak: float) -> tuple[int, float, bool]:
    """Choose the scale of a new file: bits per value, full scale, and whether it was widened.

    It is widened for a strong signal.
    """
    fitting = _scale_by_noise(samples, 8)
    if 0.0 < _needed(peak, 8) <= fitting:
        return 8, fitting, False
    fitting, needed = _scale_by_noise(samples, 16), _needed(peak, 16)
    if needed <= fitting and fitting > 0.0:
        return 16, fitting, False
    # With a margin: the signal grows while the antenna turns to it.
    return 16, 2.0 ** math.ceil(math.log2(max(HEADROOM * needed, 2.0**-100))), True


def _scale_by_noise(samples: NDArray[np.complex64], bits: int) -> float:
    """Full scale at which the noise has `NOISE_STEPS` quantization steps; 0 without noise.

    The noise is the median over the middle of the channel's spectrum, which excludes pulses,
    carriers and zeros in place of lost samples.
    """
    rows = samples[: len(samples) // WINDOW * WINDOW].reshape(-1, WINDOW)
    rows = rows[rows.all(axis=1)]
    if len(rows):
        window = np.hanning(WINDOW).astype(np.float32)
        spectrum = np.fft.fft(rows * window, axis=1)
        middle = np.concatenate((spectrum[:, : WINDOW // 4], spectrum[:, -WINDOW // 4 :]))
        power = middle / np.sqrt(np.sum(window**2))
    else:
        power = samples[samples != 0]
        if not len(power):
            return 0.0
    # The median of an exponential distribution is its mean times log 2; half of it is I's.
    mean = float(np.median(power.real**2 + power.imag**2)) / math.log(2.0)
    wanted = math.sqrt(mean / 2.0) * FULL_SCALE[bits] / NOISE_STEPS[bits]
    if wanted <= 2.0**-100:
        return 0.0
    parts = 2 if bits == 8 else 1  # of an octave
    return math.exp2(math.floor(parts * math.log2(wanted)) / parts)
