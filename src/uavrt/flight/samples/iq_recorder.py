"""Record samples as SigMF in a thread, so that detection never waits for the disk.

`put` only queues blocks; the thread converts and writes them. While the disk is slow or full,
blocks are dropped, counted and marked as a gap.
"""

import threading
from collections import deque
from dataclasses import replace
from pathlib import Path

from uavrt.core.errors import RecordingError
from uavrt.core.messages import IQBlock
from uavrt.flight.samples.sample_file import FreeSpace, SampleFile

QUEUE_S = 2.0
"""Longest queue of samples that wait for the disk [s]: 6 MB at 375 kS/s. An SD card may pause
for 1 s."""

WAKE_S = 0.2
"""Duration of the samples that are written at a time [s]; waking the thread costs more than the
writing."""

SETTLED_AFTER_S = 12.0
"""Time from the start of the radio in which its sample times may still be corrected quickly [s]
(`uavrt.radio.timing.sample_times`)."""


class IQRecorder:
    """Writes blocks as SigMF (cs16) while the disk has enough free space.

    The metadata describe all samples in the data file at any moment, even after a power cut.
    Nothing is written while the disk has less than `minimum_free_mb` free.
    """

    def __init__(
        self,
        base: Path,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        minimum_free_mb: float = 500.0,
        description: str = "Band of the receiver, recorded during detection",
        hardware: str = "",
    ) -> None:
        self._most_waiting = max(int(QUEUE_S * sample_rate_hz), 1)
        self._worth_waking = max(int(WAKE_S * sample_rate_hz), 1)
        self._waiting_samples = 0
        self._overflowing = False
        self._blocks: deque[IQBlock] = deque()
        self._condition = threading.Condition()
        self._closing = False
        self.dropped_samples = 0
        """Number of samples dropped because the disk was slow, full or failing."""
        self.trouble: str | None = None
        """Reason why nothing is written at present; None while writing."""
        try:
            self.file = SampleFile(
                base,
                sample_rate_hz=sample_rate_hz,
                center_frequency_hz=center_frequency_hz,
                description=description,
                hardware=hardware,
                settled_after_s=SETTLED_AFTER_S,
            )
        except FileExistsError as error:
            raise RecordingError(
                f"{base}.sigmf-data exists already", remedy="Record under a new name"
            ) from error
        except OSError as error:
            raise RecordingError(
                f"cannot record samples to {base}.sigmf-data: {error.strerror}",
                remedy="Free some space, or set [recording] iq = false",
            ) from error
        self._space = FreeSpace(base.parent, minimum_free_mb)
        self._thread = threading.Thread(target=self._run, name="iq-recorder", daemon=True)
        self._thread.start()

    @property
    def room_samples(self) -> int:
        """Number of samples that fit on the disk now."""
        return self._space.room_bytes() // self.file.bytes_per_sample

    @property
    def written_samples(self) -> int:
        """Number of samples written to the file."""
        return self.file.written_samples

    def put(self, block: IQBlock) -> bool:
        """Queue a copy of a block without waiting; False if it was dropped.

        After an overflow, blocks are dropped until the queue is half empty. This causes few
        long gaps and not many short ones.
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
            self._blocks.append(replace(block, samples=block.samples.copy()))
            self._waiting_samples += size
            if self._waiting_samples >= self._worth_waking:
                self._condition.notify()
            return True

    def close(self, timeout_s: float = 5.0) -> None:
        """Write the queued blocks for at most `timeout_s`, and stop; may be called again."""
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
            self.file.close()

    def _next_blocks(self) -> list[IQBlock]:
        """Wait until enough blocks are queued and return them; an empty list shows the end."""
        with self._condition:
            while self._waiting_samples < self._worth_waking and not self._closing:
                self._condition.wait()
            blocks = list(self._blocks)
            self._blocks.clear()
            return blocks

    def _write(self, block: IQBlock) -> None:
        if not self._space.enough():
            self._drop(block, "the disk is nearly full")
            return
        try:
            self.file.append(block.samples, block.sample_index, block.time_ns)
        except OSError as error:
            self._drop(block, error.strerror or str(error))
            return
        self.trouble = None

    def _drop(self, block: IQBlock, why: str) -> None:
        with self._condition:
            self.dropped_samples += len(block.samples)
        self.trouble = why
        self.file.break_off()
