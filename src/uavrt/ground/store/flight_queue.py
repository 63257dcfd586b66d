"""Queue of writes to a ground station's flights, with a count of completed writes."""

import asyncio
from collections.abc import Callable
from pathlib import Path

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RecordingError
from uavrt.core.log import get_logger
from uavrt.core.runtime.disk_thread import Disk, DiskBatches
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.ground.store.flight_writer import FlightWriter, Stored, Written

log = get_logger()

MOST_WAITING = 10_000
"""Maximum number of pulses queued while the disk fails. The drone keeps all others, and repeats
them until they are acknowledged."""
MOST_RECORDS = 20_000
"""Maximum number of poses, notes and similar records queued while the disk does not answer."""
RETRY_S = 1.0
"""Pause before a failed write to a flight's files is repeated [s]."""
SLOW_S = 2.0
"""Duration above which a write is reported as slow [s]; a healthy card takes milliseconds."""
SETTLE_CHECK_S = 0.01
"""Interval at which `settle` checks whether a write has ended [s]."""


class FlightQueue:
    """Passes writes to a `FlightWriter` in the disk thread, without waiting for the disk."""

    def __init__(
        self,
        directory: Path,
        disk: Disk,
        also: Callable[[Stored], object],
        on_written: Callable[[], None],
    ) -> None:
        self.writer = FlightWriter(also)
        self._directory = directory
        self._on_written = on_written
        self._works: DiskBatches[tuple[bool, Callable[[FlightWriter], None]], Written] = (
            DiskBatches(disk, self.writer.write, self._written)
        )
        """Queued writes; each with True if a receipt waits for it."""
        self._taken = self._applied = self._durable = 0
        self._left_out = 0
        self._retry_at_s = 0.0
        self._reported = False
        self._error: str | None = None
        self._mended = ""

    @property
    def fault(self) -> str | None:
        """Reason why data is not on disk, or a note that the disk is slow; None if neither."""
        handed_s = self._works.handed_s
        now_s = 0.0 if handed_s is None else monotonic_s() - handed_s
        before_s = 0.0 if self._error is not None or self.stored else self._works.took_s
        slow_s = max(now_s, before_s)
        if slow_s < SLOW_S:
            return self._error
        error = RecordingError(
            f"the disk of {self._directory} takes {slow_s:.0f} s to write: "
            f"{self._waiting} pulses wait in memory",
            remedy="Check or replace the disk",
        )
        return str(error)

    @property
    def progress(self) -> tuple[int, int]:
        """Numbers of accepted items and of items on disk (pulses, pulse times of bursts)."""
        return self._taken, self._durable

    @property
    def stored(self) -> bool:
        """True if every accepted pulse is on the disk."""
        return not self._waiting

    @property
    def _waiting(self) -> int:
        return self._taken - self._durable

    def store(self, work: Callable[[FlightWriter], None]) -> None:
        """Queue a write that a receipt waits for; raises `RecordingError` if too many wait."""
        if self._waiting >= MOST_WAITING:
            raise RecordingError(self.fault or "the disk is too slow for the pulses received")
        self.put(work, counts=True)

    def put(self, work: Callable[[FlightWriter], None], *, counts: bool = False) -> None:
        """Queue a write for the next commit; with `counts` a receipt waits for it."""
        self._taken += counts
        self._works.waiting.append((counts, work))

    def record(self, write: Callable[[FlightRecorder], None]) -> None:
        """Queue a write that needs no receipt; it is discarded if the queue is full."""
        if len(self._works.waiting) < MOST_WAITING + MOST_RECORDS:
            self.put(lambda writer: writer.record(write))
        else:
            self._left_out += 1
            log.seldom(
                self._left_out,
                "poses and notes are being discarded, because the disk does not answer",
            )

    def commit(self, *, at_once: bool = False) -> None:
        """Write the queue to the disk, one second after a fault unless `at_once`.

        Writes that the disk refuses stay in the queue.
        """
        fault = self.fault
        if fault is not None and not self._reported:
            log.warning(
                "the flight cannot be written; received data wait in memory", reason=fault
            )
        self._reported = fault is not None
        if at_once:
            self._retry_at_s = 0.0
        if monotonic_s() >= self._retry_at_s:
            self._works.write()

    def _written(
        self, works: list[tuple[bool, Callable[[FlightWriter], None]]], written: Written
    ) -> None:
        """Update the number of items known to be on the disk after a write."""
        self._applied += sum(counts for counts, _ in works)
        if written.fault is None:
            self._durable = self._applied
        else:
            self._retry_at_s = monotonic_s() + RETRY_S
        self._error = written.fault
        self._mended = written.mended or self._mended
        self._on_written()

    def mended(self) -> str:
        """Text on a repaired fault of the flight's database; each is returned only once."""
        text, self._mended = self._mended, ""
        return text

    async def settle(self, within_s: float) -> None:
        """Wait until all data is written or refused, for `within_s` at most."""
        if self._works.waiting:
            self.commit()
        end_s = monotonic_s() + within_s
        while self._works.handed_s is not None and monotonic_s() < end_s:  # noqa: ASYNC110
            await asyncio.sleep(SETTLE_CHECK_S)
