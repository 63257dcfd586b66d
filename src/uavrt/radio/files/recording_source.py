"""Read samples from a file: raw, SigMF or WAV.

A function for each of the three kinds (`raw_layout`, and those in `uavrt.radio.files.sigmf` and
`uavrt.radio.files.wav`) describes the file as a `Layout`. `RecordingSource` reads the samples
of any `Layout`.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, Protocol

from uavrt.core.clock import iso_utc
from uavrt.core.errors import FormatError
from uavrt.core.foreign import require_plain_file
from uavrt.core.messages import IQBlock
from uavrt.radio.files.file_names import NameFacts
from uavrt.radio.formats import SampleFormat, clean, look_like_floats
from uavrt.radio.live_source import check_rates
from uavrt.radio.timing.sample_times import NominalTimes

GIVEN_BY_USER: Final = "your options"
HEADER: Final = "the file's header"
FILE_DATE: Final = "the date of the file, which copying may change: give --start-time"
_MAX_BLOCK: Final = 262_144
"""Largest block read from a file [samples] (2 MiB); single channels are read 1 s at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Part of a recording without gaps: consecutive samples in a file."""

    first: int
    """Position of the segment's first sample in the file [samples]."""
    count: int
    sample_index: int
    """Index of the segment's first sample in the recording; lost samples count."""
    time_ns: int
    lost_before: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Describes a recording's file: positions of its samples, rate, frequency and times."""

    path: Path
    sample_format: SampleFormat
    sample_rate_hz: float
    center_frequency_hz: float
    segments: tuple[Segment, ...]
    frequency_from: str = GIVEN_BY_USER
    rate_from: str = GIVEN_BY_USER
    start_from: str = GIVEN_BY_USER
    first_byte: int = 0
    fault_at_end: str | None = None
    """Reason why the recording is incomplete; None if it is complete. It is raised as an error
    after the last complete sample has been read."""


class SampleBytes(Protocol):
    """Interface of a file whose bytes can be read from any position."""

    def read_at(self, view: memoryview, offset: int) -> int:
        """Read bytes from a position into `view`; return their number, 0 at the file's end."""

    def close(self) -> None:
        """Close the file that contains the samples."""


class _FileBytes:
    def __init__(self, path: Path) -> None:
        self._path = path
        with reading(path):
            self._file = path.open("rb", buffering=0)

    def read_at(self, view: memoryview, offset: int) -> int:
        with reading(self._path):
            return os.preadv(self._file.fileno(), [view], offset)

    def close(self) -> None:
        self._file.close()


class RecordingSource:
    """Reads a recording's samples as quickly as the disk allows; raises `FormatError`."""

    def __init__(self, layout: Layout, stored: SampleBytes | None = None) -> None:
        check_rates(layout.sample_rate_hz, layout.center_frequency_hz)
        self.name = str(layout.path)
        self.invalid_values = 0
        self.samples_lost = 0
        self.layout = layout
        """Description of the file: positions of its samples, rate, frequency and times."""
        self.sample_rate_hz = layout.sample_rate_hz
        self.center_frequency_hz = layout.center_frequency_hz
        self.segments = layout.segments
        """Parts of the recording between its gaps; the samples of each part are consecutive."""
        self.start_time_ns = layout.segments[0].time_ns
        """Time of the recording's first sample [ns, UTC]."""
        self.total_samples: int | None = sum(segment.count for segment in layout.segments)
        """Number of samples in the recording."""
        self._format = layout.sample_format
        if self.total_samples == 0:
            raise FormatError(
                f"{layout.path} holds no samples",
                remedy="Check the recording's size and its --format",
            )
        rate_hz = layout.sample_rate_hz
        samples = min(_MAX_BLOCK, max(64, round(rate_hz)))
        self._samples, self._raw = self._format.buffers(samples)
        self._segments = iter([s for s in layout.segments if s.count])
        self._segment = next(self._segments)
        self._times = NominalTimes(self._segment.time_ns, rate_hz)
        self._done = 0
        self._pending_lost = self._segment.lost_before
        self._file: SampleBytes = stored or _FileBytes(layout.path)

    def skip_to(self, place: int) -> None:
        """Continue reading at a sample; `place`: its position in the file, counted from 0.

        Samples that the recording lost are not counted in `place`.
        """
        held = [one for one in self.layout.segments if one.count]
        for number, segment in enumerate(held):
            if place < segment.count or number == len(held) - 1:
                break
            place -= segment.count
        self._segments = iter(held[number + 1 :])
        self._segment, self._done = segment, min(place, segment.count)
        self._times = NominalTimes(segment.time_ns, self.sample_rate_hz)
        self._pending_lost = 0 if self._done else segment.lost_before

    @property
    def dated_by_file(self) -> bool:
        """True if the start time was derived from the file's modification date."""
        return self.layout.start_from == FILE_DATE

    @property
    def origin(self) -> str:
        """Text that says where rate, frequency and start time come from.

        Values that the user gave are left out; the text is empty if the user gave all three.
        """
        layout = self.layout
        origins = (
            (f"{layout.center_frequency_hz / 1e6:.6f} MHz", layout.frequency_from),
            (f"{layout.sample_rate_hz:.0f} samples a second", layout.rate_from),
            (f"begun {iso_utc(self.start_time_ns)}", layout.start_from),
        )
        return "; ".join(f"{what} by {who}" for what, who in origins if who != GIVEN_BY_USER)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block without waiting; raises `EOFError` at the end of the recording."""
        del timeout_s
        if self._done == self._segment.count:
            self._next_segment()
        segment, size = self._segment, self._format.bytes_per_sample
        count = min(len(self._samples), segment.count - self._done)
        offset = self.layout.first_byte + (segment.first + self._done) * size
        self._fill(offset, count * size)
        samples = self._samples[:count]
        if not self._format.in_place:
            self._format.convert(self._raw[: count * size], samples)
        if self._format.dtype.kind == "f":
            self.invalid_values += clean(samples, self.name)
        block = IQBlock(
            samples=samples,
            sample_index=segment.sample_index + self._done,
            time_ns=self._times.time_ns(self._done),
            sample_rate_hz=self.sample_rate_hz,
            lost_before=self._pending_lost,
        )
        self.samples_lost += self._pending_lost
        self._pending_lost = 0
        self._done += count
        return block

    def close(self) -> None:
        """Close the recording's file."""
        self._file.close()

    def _next_segment(self) -> None:
        following = next(self._segments, None)
        if following is None:
            if self.layout.fault_at_end is not None:
                raise FormatError(
                    self.layout.fault_at_end,
                    remedy="Check whether the file is truncated or in another format; "
                    "all complete samples were used",
                )
            raise EOFError(f"{self.name} has ended")
        self._segment, self._done = following, 0
        self._times = NominalTimes(following.time_ns, self.sample_rate_hz)
        self._pending_lost = following.lost_before

    def _fill(self, offset: int, count: int) -> None:
        view = self._raw.data[:count]
        filled = 0
        while filled < count:
            got = self._file.read_at(view[filled:], offset + filled)
            if got == 0:
                raise FormatError(
                    f"{self.name} became shorter while it was read",
                    remedy="Wait until the recording is complete",
                )
            filled += got


def name_note(facts: NameFacts, about: Literal["rate", "frequency", "time"]) -> str:
    """Text that names the file's name as the source of a value.

    It also states the time zone of a time and the rounding of a frequency.
    """
    said = f"the file's name (as {facts.program} gives)"
    if about == "time" and facts.local_time:
        said += ", the local time of the computer that recorded, taken to be this one's zone"
    if about == "frequency" and facts.frequency_step_hz is not None:
        khz = facts.frequency_step_hz / 1e3
        said += f", rounded to {khz:g} kHz: give --center-frequency, or widen the window"
    return said


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Context manager that raises `FormatError` with a remedy if a file cannot be read."""
    try:
        yield
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        remedy = "Check the path" if missing else "Check its permissions"
        raise FormatError(f"cannot read {path}: {error.strerror}", remedy=remedy) from error


def file_size(path: Path) -> int:
    """Size of a file [bytes]; raises `FormatError` if it is missing or not a regular file."""
    with reading(path):
        if path.is_dir():
            raise FormatError(f"{path} is a directory", remedy="Name a recording in it")
        require_plain_file(path)
        return path.stat().st_size


def file_start_ns(path: Path, samples: int, sample_rate_hz: float) -> int:
    """Estimate a recording's start: file modification time minus duration [ns, UTC]."""
    return path.stat().st_mtime_ns - NominalTimes(0, sample_rate_hz).time_ns(samples)


def raw_layout(
    path: Path,
    sample_format: SampleFormat,
    *,
    sample_rate_hz: float,
    center_frequency_hz: float,
    start_time_ns: int | None = None,
    frequency_from: str = GIVEN_BY_USER,
    rate_from: str = GIVEN_BY_USER,
    start_from: str = GIVEN_BY_USER,
) -> Layout:
    """Describe a file of raw samples.

    The arguments `frequency_from`, `rate_from` and `start_from` say where each value comes
    from.
    """
    check_rates(sample_rate_hz, center_frequency_hz)
    size = file_size(path)
    if sample_format.dtype.kind != "f":
        _refuse_floats(path, sample_format)
    count, rest = divmod(size, sample_format.bytes_per_sample)
    if start_time_ns is None:
        start_time_ns, start_from = file_start_ns(path, count, sample_rate_hz), FILE_DATE
    return Layout(
        path=path,
        sample_format=sample_format,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=center_frequency_hz,
        segments=(Segment(first=0, count=count, sample_index=0, time_ns=start_time_ns),),
        frequency_from=frequency_from,
        rate_from=rate_from,
        start_from=start_from,
        fault_at_end=(
            f"{path} ends in the middle of a sample ({rest} bytes of "
            f"{sample_format.bytes_per_sample} as {sample_format.name})"
            if rest
            else None
        ),
    )


def _refuse_floats(path: Path, sample_format: SampleFormat) -> None:
    with reading(path), path.open("rb") as file:
        # Enough samples to decide, in negligible time.
        start = file.read(1 << 16)
    if look_like_floats(start):
        raise FormatError(
            f"{path} does not hold {sample_format.name}: these are float samples",
            remedy="Give --format cf32",
        )
