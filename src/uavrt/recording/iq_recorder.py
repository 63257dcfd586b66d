"""Records samples as SigMF beside detection, and always gives way to it.

The caller hands over blocks and goes on at once. A thread of its own converts and writes them;
while the disk is slow or full, blocks are dropped, counted and marked as a gap.
"""

import json
import os
import threading
from collections import deque
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.clock import monotonic_s
from uavrt.config.text_files import write_text_atomically
from uavrt.errors import RecordingError
from uavrt.messages import IQBlock
from uavrt.recording.sigmf_metadata import FULL_SCALE, Stretch, sigmf_metadata

QUEUE_S = 2.0
"""Samples that may wait for the disk: 6 MB at 375 kS/s; a hiccup of an SD card is 1 s."""

WAKE_S = 0.2
"""The thread wakes for this much at once: most of its cost is the waking."""

_FREE_SPACE_PERIOD_S = 1.0
_BYTES_PER_SAMPLE = 4


class IQRecorder:
    """Writes blocks as ``NAME.sigmf-data`` (cs16) and ``NAME.sigmf-meta``.

    The metadata is valid JSON and describes all samples of the data file at any moment, also
    after a power cut.

    Parameters
    ----------
    base : Path
        Directory and NAME, without a suffix; the directory is made.
    sample_rate_hz, center_frequency_hz : float
        Of the blocks that will come [Hz].
    minimum_free_mb : float
        Nothing is written while the disk has less free space [MB].
    hardware : str
        The radio, for the metadata.

    Raises
    ------
    RecordingError
        The files cannot be made, or exist already.
    """

    def __init__(
        self,
        base: Path,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        minimum_free_mb: float = 500.0,
        hardware: str = "",
    ) -> None:
        self.data_path = base.with_name(f"{base.name}.sigmf-data")
        self.metadata_path = base.with_name(f"{base.name}.sigmf-meta")
        self._sample_rate_hz = sample_rate_hz
        self._center_frequency_hz = center_frequency_hz
        self._minimum_free_bytes = minimum_free_mb * 1e6
        self._hardware = hardware
        self._most_waiting = max(int(QUEUE_S * sample_rate_hz), 1)
        self._worth_waking = max(int(WAKE_S * sample_rate_hz), 1)
        self._stretches: list[Stretch] = []
        self._next_index: int | None = None
        self._free_checked_s = float("-inf")
        self._free = True
        self._waiting_samples = 0
        self._overflowing = False
        self._blocks: deque[IQBlock] = deque()
        self._condition = threading.Condition()
        self._closing = False
        self.written_samples = 0
        self.dropped_samples = 0
        """Samples given up because the disk was slow, full or failing."""
        self.clipped_samples = 0
        """Samples beyond full scale, stored at its edge."""
        self.gaps = 0
        self.trouble: str | None = None
        """Why nothing is being written now; None when all is well."""
        if self.data_path.is_file():
            raise RecordingError(
                f"{self.data_path} exists already", remedy="Record under a new name"
            )
        try:
            base.parent.mkdir(parents=True, exist_ok=True)
            self._write_metadata()
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
            self._file = os.open(self.data_path, flags, 0o644)
        except OSError as error:
            raise RecordingError(
                f"cannot record samples to {self.data_path}: {error.strerror}",
                remedy="Free space, or switch [recording] iq off",
            ) from error
        self._thread = threading.Thread(target=self._run, name="iq-recorder", daemon=True)
        self._thread.start()

    def put(self, block: IQBlock) -> bool:
        """Hand over a block and go on at once; False when it had to be dropped.

        The samples are copied. Once the queue has overflowed it takes nothing until it is half
        empty, so that a slow disk makes few long gaps instead of many short ones.
        """
        size = len(block.samples)
        with self._condition:
            if self._overflowing and self._waiting_samples <= self._most_waiting // 2:
                self._overflowing = False
            if self._waiting_samples + size > self._most_waiting and self._waiting_samples:
                self._overflowing = True
            if self._overflowing or self._closing:
                self.dropped_samples += size
                return False
            copy = IQBlock(
                samples=block.samples.copy(),
                sample_index=block.sample_index,
                time_ns=block.time_ns,
                sample_rate_hz=block.sample_rate_hz,
                lost_before=block.lost_before,
            )
            self._blocks.append(copy)
            self._waiting_samples += size
            if self._waiting_samples >= self._worth_waking:
                self._condition.notify()
            return True

    def close(self, timeout_s: float = 5.0) -> None:
        """Write what waits, for at most `timeout_s`, and end; harmless when repeated."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            while blocks := self._next_blocks():
                for block in blocks:
                    self._write(block)
                    with self._condition:
                        self._waiting_samples -= len(block.samples)
        finally:
            os.close(self._file)

    def _next_blocks(self) -> list[IQBlock]:
        """Wait for blocks worth a write; none at the end."""
        with self._condition:
            while self._waiting_samples < self._worth_waking and not self._closing:
                self._condition.wait()
            blocks = list(self._blocks)
            self._blocks.clear()
            return blocks

    def _write(self, block: IQBlock) -> None:
        """Write a block as a whole or not at all."""
        if not self._enough_space():
            self._drop(block, "the disk is nearly full")
            return
        try:
            if block.sample_index != self._next_index:
                self._begin_stretch(block)
            self._append(self._as_int16(block.samples))
        except OSError as error:
            self._drop(block, error.strerror or str(error))
            return
        self.written_samples += len(block.samples)
        self._next_index = block.sample_index + len(block.samples)
        self.trouble = None

    def _drop(self, block: IQBlock, why: str) -> None:
        with self._condition:
            self.dropped_samples += len(block.samples)
        self.trouble = why
        self._next_index = None

    def _begin_stretch(self, block: IQBlock) -> None:
        """Say where the samples that follow belong, before they are written.

        In this order a power cut leaves at worst a last capture without samples, never samples
        at a wrong time.
        """
        stretch = Stretch(
            sample_start=self.written_samples,
            global_index=block.sample_index,
            time_ns=block.time_ns,
        )
        # A stretch that got no samples (the disk was full) is replaced, not kept.
        kept = [one for one in self._stretches if one.sample_start < self.written_samples]
        self._stretches = [*kept, stretch]
        self.gaps = len(self._stretches) - 1
        self._write_metadata()

    def _write_metadata(self) -> None:
        metadata = sigmf_metadata(
            self._stretches,
            sample_rate_hz=self._sample_rate_hz,
            center_frequency_hz=self._center_frequency_hz,
            hardware=self._hardware,
            description="Band of the receiver, recorded during detection",
        )
        write_text_atomically(self.metadata_path, json.dumps(metadata, indent=1) + "\n")

    def _as_int16(self, samples: NDArray[np.complex64]) -> NDArray[np.int16]:
        """Interleaved I and Q, rounded; beyond full scale at its edge, counted.

        float32 throughout: its 24 bits hold every int16.
        """
        scaled = np.ascontiguousarray(samples).view(np.float32) * np.float32(FULL_SCALE)
        np.rint(scaled, out=scaled)
        # Two passes in the common case; a NaN fails both comparisons and is seen, too.
        if not (scaled.max(initial=0.0) <= 32_767.0 and scaled.min(initial=0.0) >= -32_768.0):
            over = (scaled > 32_767.0) | (scaled < -32_768.0)
            self.clipped_samples += int(np.count_nonzero(over.reshape(-1, 2).any(axis=1)))
            np.nan_to_num(scaled, copy=False)
            np.clip(scaled, -32_768.0, 32_767.0, out=scaled)
        return scaled.astype("<i2")

    def _append(self, values: NDArray[np.int16]) -> None:
        content = values.view(np.uint8).data
        try:
            while content:
                content = content[os.write(self._file, content) :]
        except OSError:
            os.ftruncate(self._file, self.written_samples * _BYTES_PER_SAMPLE)
            raise

    def _enough_space(self) -> bool:
        now_s = monotonic_s()
        if now_s - self._free_checked_s >= _FREE_SPACE_PERIOD_S:
            self._free_checked_s = now_s
            try:
                status = os.statvfs(self.data_path.parent)
            except OSError:
                return False
            self._free = status.f_bavail * status.f_frsize >= self._minimum_free_bytes
        return self._free
