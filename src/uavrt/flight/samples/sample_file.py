"""Write a SigMF recording whose metadata are valid at any moment."""

import json
import os
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.core.atomic_file import write_atomically
from uavrt.core.clock import monotonic_s
from uavrt.core.units import ns_from_s
from uavrt.flight.samples.sigmf_metadata import FULL_SCALE, Stretch, sigmf_metadata

BYTES_PER_SAMPLE = 4
_FREE_SPACE_PERIOD_S = 1.0
_LEAST_MOVE_NS = 1_000_000
"""Smallest correction of the start time of consecutive samples that is written to the metadata
[ns]."""


class SampleFile:
    """Writes ``NAME.sigmf-data`` (cs16 or ci8) and ``NAME.sigmf-meta``, valid at any moment.

    An input of `full_scale` is stored as 32 768 with 16 `bits`, and as 128 with 8 bits. Sample
    times from a new radio are still corrected during `settled_after_s`. After that, or when a
    stretch of samples ends, the start time of the stretch is corrected in the metadata.
    """

    def __init__(
        self,
        base: Path,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        description: str,
        hardware: str = "",
        full_scale: float = 1.0,
        sync: bool = True,
        bits: int = 16,
        settled_after_s: float | None = None,
    ) -> None:
        self.data_path = base.with_name(f"{base.name}.sigmf-data")
        self.metadata_path = base.with_name(f"{base.name}.sigmf-meta")
        self.full_scale = full_scale
        self.bits = bits
        self.bytes_per_sample = BYTES_PER_SAMPLE * bits // 16
        self.written_samples = 0
        self.clipped_samples = 0
        """Number of samples beyond full scale, which are stored at the limit."""
        self._sample_rate_hz = sample_rate_hz
        self._center_frequency_hz = center_frequency_hz
        self._description = description
        self._hardware = hardware
        self._sync = sync
        self._settled_after_s = settled_after_s
        self._moved_ns: int | None = None
        """Correction of the sample clock since the stretch began [ns]; None once settled."""
        self._stretches: list[Stretch] = []
        self._next_index: int | None = None
        if self.data_path.is_file():
            raise FileExistsError(f"{self.data_path} exists already")
        base.parent.mkdir(parents=True, exist_ok=True)
        self._write_metadata()
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
        self._file = os.open(self.data_path, flags, 0o644)

    @property
    def gaps(self) -> int:
        """Number of gaps in the recording, between stretches of consecutive samples."""
        return max(0, len(self._stretches) - 1)

    def append(self, samples: NDArray[np.complex64], sample_index: int, time_ns: int) -> None:
        """Scale and write samples, completely or not at all.

        `sample_index`: number of the first sample in the radio's stream. `time_ns`: its time
        [ns, UTC]. A jump of either begins a new stretch.
        """
        values = self._scaled(samples)
        try:
            if sample_index != self._next_index:
                self._begin_stretch(sample_index, time_ns)
            elif self._moved_ns is not None:
                self._follow_clock(sample_index, time_ns)
            self._write(values)
        except OSError:
            self._next_index = None
            raise
        self.written_samples += len(samples)
        self._next_index = sample_index + len(samples)

    def break_off(self) -> None:
        """End the present stretch of consecutive samples; the next samples begin another."""
        self._next_index = None

    def close(self) -> None:
        """Complete the metadata and close the data file."""
        if self._place_stretch():
            with suppress(OSError):  # a full disk: the first reading of the clock stands
                self._write_metadata()
        os.close(self._file)

    def _follow_clock(self, sample_index: int, time_ns: int) -> None:
        """Store how far the clock was corrected; once it is settled, correct the stretch."""
        last = self._stretches[-1]
        lasts_s = (sample_index - last.global_index) / self._sample_rate_hz
        self._moved_ns = time_ns - last.time_ns - ns_from_s(lasts_s)
        if lasts_s >= (self._settled_after_s or 0.0) and self._place_stretch():
            self._write_metadata()

    def _place_stretch(self) -> bool:
        """Correct the last stretch's start time by its newest samples; True if it changed."""
        moved_ns, self._moved_ns = self._moved_ns, None
        if moved_ns is None or abs(moved_ns) < _LEAST_MOVE_NS:
            return False
        last = self._stretches[-1]
        self._stretches[-1] = replace(last, time_ns=last.time_ns + moved_ns)
        return True

    def _begin_stretch(self, sample_index: int, time_ns: int) -> None:
        """Write the metadata of a stretch before its samples are written.

        After a power cut, the file may thus have a capture without samples, but no samples at a
        wrong time.
        """
        stretch = Stretch(
            sample_start=self.written_samples, global_index=sample_index, time_ns=time_ns
        )
        self._place_stretch()
        # A stretch that got no samples (the disk was full) is replaced, not kept.
        kept = [one for one in self._stretches if one.sample_start < self.written_samples]
        self._stretches = [*kept, stretch]
        self._moved_ns = None if self._settled_after_s is None else 0
        self._write_metadata()

    def _write_metadata(self) -> None:
        metadata = sigmf_metadata(
            self._stretches,
            sample_rate_hz=self._sample_rate_hz,
            center_frequency_hz=self._center_frequency_hz,
            hardware=self._hardware,
            description=self._description,
            full_scale=self.full_scale,
            bits=self.bits,
        )
        text = json.dumps(metadata, indent=1) + "\n"
        write_atomically(self.metadata_path, text, sync=self._sync)

    def _scaled(self, samples: NDArray[np.complex64]) -> NDArray[np.int16] | NDArray[np.int8]:
        """Round I and Q to interleaved integers; values beyond full scale are clipped."""
        low, high = -FULL_SCALE[self.bits], FULL_SCALE[self.bits] - 1.0
        factor = np.float32(FULL_SCALE[self.bits] / self.full_scale)
        scaled = np.ascontiguousarray(samples).view(np.float32) * factor
        np.rint(scaled, out=scaled)
        # Two passes in the common case; a NaN fails both comparisons and is seen, too.
        if not (scaled.max(initial=0.0) <= high and scaled.min(initial=0.0) >= low):
            over = (scaled > high) | (scaled < low)
            self.clipped_samples += int(np.count_nonzero(over.reshape(-1, 2).any(axis=1)))
            np.nan_to_num(scaled, copy=False)
            np.clip(scaled, low, high, out=scaled)
        return scaled.astype("i1") if self.bits == 8 else scaled.astype("<i2")

    def _write(self, values: NDArray[np.int16] | NDArray[np.int8]) -> None:
        content = values.view(np.uint8).data
        try:
            while content:
                content = content[os.write(self._file, content) :]
        except OSError:
            os.ftruncate(self._file, self.written_samples * self.bytes_per_sample)
            raise


class FreeSpace:
    """Checks once a second that a disk has more than a required free space [MB]."""

    def __init__(self, directory: Path, minimum_free_mb: float) -> None:
        self._directory = directory
        self._minimum_free_bytes = minimum_free_mb * 1e6
        self._checked_s = float("-inf")
        self._free = True

    def enough(self) -> bool:
        """True if there is enough free space; False if the free space cannot be measured."""
        now_s = monotonic_s()
        if now_s - self._checked_s >= _FREE_SPACE_PERIOD_S:
            self._checked_s = now_s
            self._free = self.room_bytes() > 0
        return self._free

    def room_bytes(self) -> int:
        """Number of bytes that may still be written; 0 if the free space cannot be measured."""
        try:
            status = os.statvfs(self._directory)
        except OSError:
            return 0
        return max(0, int(status.f_bavail * status.f_frsize - self._minimum_free_bytes))
