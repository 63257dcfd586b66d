"""Read several recordings of one channel as one recording, in order of time."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from uavrt.core.errors import FormatError
from uavrt.core.messages import IQBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.radio.files.recording_source import Layout, RecordingSource
from uavrt.radio.files.sigmf import sigmf_layout

_NO_GAP_S = 0.001
"""Maximum time between two recordings without a gap [s]; times in files are rounded."""


class JoinedRecording:
    """Reads several SigMF recordings of one channel as one stream with gaps between them."""

    def __init__(self, paths: Sequence[Path]) -> None:
        layouts: list[Layout] = []
        self.left_out: list[str] = []
        """Unreadable recordings that were left out, with the reasons."""
        for path in paths:
            try:
                layout = sigmf_layout(path)
            except FormatError as error:
                self.left_out.append(error.message)
                continue
            if any(segment.count for segment in layout.segments):
                layouts.append(layout)
        if not layouts:
            why = f": {self.left_out[0]}" if self.left_out else ""
            raise FormatError(
                f"the recordings hold no samples{why}",
                remedy="Choose recordings that contain samples",
            )
        self._layouts = sorted(layouts, key=_start_ns)
        first = self._layouts[0]
        alien = next((one for one in layouts if _kind(one) != _kind(first)), None)
        if alien is not None:
            raise FormatError(
                f"{alien.path} and {first.path} differ in sample rate or frequency",
                remedy="Choose recordings of one channel",
            )
        self.name = str(first.path.parent)
        self.sample_rate_hz = first.sample_rate_hz
        self.center_frequency_hz = first.center_frequency_hz
        self.start_time_ns = _start_ns(first)
        self.invalid_values = self.samples_lost = 0
        self._next = 0
        self._source: RecordingSource | None = None
        self._index = 0
        """Index of the next sample of the joined recordings, including lost ones."""
        self._end_ns: int | None = None

    @property
    def total_samples(self) -> int | None:
        """Total number of samples in all recordings."""
        return sum(segment.count for one in self._layouts for segment in one.segments)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block without waiting; raises `EOFError` after the last recording."""
        del timeout_s
        while True:
            if self._source is None:
                self._open_next()
            assert self._source is not None
            try:
                block = self._source.read()
            except EOFError:
                self.close()
                continue
            except FormatError as error:  # it ends in the middle of a sample
                self.left_out.append(error.message)
                self.close()
                continue
            assert block is not None
            return self._placed(block)

    def close(self) -> None:
        """Close the recording that is being read."""
        if self._source is not None:
            self.invalid_values += self._source.invalid_values
            self._source.close()
            self._source = None

    def _open_next(self) -> None:
        while self._next < len(self._layouts) and self._source is None:
            layout = self._layouts[self._next]
            self._next += 1
            try:
                self._source = RecordingSource(layout)
            except FormatError as error:  # removed meanwhile
                self.left_out.append(error.message)
        if self._source is None:
            raise EOFError(f"{self.name} has ended")

    def _placed(self, block: IQBlock) -> IQBlock:
        lost = block.lost_before
        if self._end_ns is not None:
            gap_s = (block.time_ns - self._end_ns) / NANOSECONDS_PER_SECOND
            lost = round(gap_s * self.sample_rate_hz) if gap_s > _NO_GAP_S else 0
        self.samples_lost += lost
        index = self._index + lost
        self._index = index + len(block.samples)
        duration_ns = round(len(block.samples) / self.sample_rate_hz * NANOSECONDS_PER_SECOND)
        self._end_ns = block.time_ns + duration_ns
        return replace(block, sample_index=index, lost_before=lost)


def _start_ns(layout: Layout) -> int:
    return layout.segments[0].time_ns


def _kind(layout: Layout) -> tuple[float, float]:
    return layout.sample_rate_hz, layout.center_frequency_hz
