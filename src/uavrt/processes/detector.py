"""The detector process: channel samples in, pulses of several tags out."""

import select
import socket
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uavrt.config.ghost_places import Receiver
from uavrt.config.settings import DetectionSettings
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt.dsp.clipping import ClippedTimes
from uavrt.errors import UavrtError
from uavrt.ipc.process import ProcessFrame
from uavrt.ipc.samples import ChannelReceiver
from uavrt.log import get_logger
from uavrt.messages import ChannelBlock, FlightInfo, Pulse, SearchReport, Tag
from uavrt.processes.hang_watch import HangWatch
from uavrt.processes.latencies import Latencies
from uavrt.units import NANOSECONDS_PER_SECOND

if TYPE_CHECKING:
    from uavrt.detection.coded.detector import CodedDetector

log = get_logger()

FAULTS_OF_A_TAG = 2
"""Failures of a detector after which its tag is no longer searched."""
SELECT_S = 0.2
LIVE_NS = 1_500_000_000
"""Age above which samples count as backlog, e.g. after a restart [ns]. Blocks and filters alone
delay them by 0.2 s."""


class DetectorBank:
    """One `PulseDetector` for each tag, made when its channel's first block comes.

    A detector that fails or hangs must not cost the others their pulses. All detectors are then
    rebuilt, and the suspects are searched one by one. A tag whose search fails twice is left
    out and reported by name.

    `tags`: the tags this worker serves. `settings`: window and operating mode. `flight`: radio
    settings, needed to reject its ghosts of a strong tag.
    """

    def __init__(
        self,
        tags: tuple[Tag, ...],
        settings: DetectionSettings,
        flight: FlightInfo | None = None,
    ) -> None:
        self._tags = tags
        self._settings = settings
        self._receiver = None
        if flight is not None:
            self._receiver = Receiver(flight.center_frequency_hz, flight.sample_rate_hz)
        self._group = DetectorGroup(self._receiver)
        self._coded: dict[int, CodedDetector] = {}
        self._bursts: list[Pulse] = []
        self._watch = HangWatch(lambda: self._group.last_searched)
        self._clipped = ClippedTimes()
        self._clipped_ns: tuple[tuple[int, int], ...] = ()
        """Clipped times of the last block; the same for all channels of a radio block."""
        self._faults: Counter[int] = Counter()
        self._alone: frozenset[int] = frozenset()
        self.left_out: dict[int, Tag] = {}
        """Tags that are no longer searched, by id."""
        self.failures = 0
        self.samples = 0
        self.samples_lost = 0
        self.last_sample_ns = 0
        self.samples_invalid = 0

    def put(self, block: ChannelBlock) -> None:
        """Feed a block to the detectors of its channel; `collect` searches it."""
        self.samples += len(block.samples)
        self.samples_lost += block.lost_before
        self.last_sample_ns = block.time_ns + round(
            len(block.samples) * NANOSECONDS_PER_SECOND / block.sample_rate_hz
        )
        if block.clipped_ns is not self._clipped_ns:
            self._clipped_ns = block.clipped_ns
            self._clipped.add(block.clipped_ns)
        with self._surviving():
            self._group.carriers_hz = block.carriers_hz
            if block.channel in self._group or self._add(block):
                self._group.put(block.channel, self._finite(block.samples), block.time_ns)
        self._put_coded(block)

    def _put_coded(self, block: ChannelBlock) -> None:
        """Search a block for coded tags; after two failures they are left out."""
        codes = [tag for tag in self._of_channel(block) if tag.coded]
        if not codes:
            return
        try:
            if block.channel not in self._coded:
                # Loads scipy.special, 22 MB.
                from uavrt.detection.coded.detector import CodedDetector

                self._coded[block.channel] = CodedDetector(
                    codes,
                    sample_rate_hz=block.sample_rate_hz,
                    center_frequency_hz=block.center_frequency_hz,
                    frequency_window_hz=self._settings.frequency_window_hz,
                )
            coded = self._coded[block.channel]
            self._bursts += coded.process(self._finite(block.samples), block.time_ns)
        except Exception as error:
            log.exception("search failed", tags=[tag.tag_id for tag in codes])
            self._coded.pop(block.channel, None)
            self.failures += 1
            for tag in codes:
                self._faults[tag.tag_id] += 1
                if self._faults[tag.tag_id] >= FAULTS_OF_A_TAG:
                    self._leave_out(tag, error)

    def collect(self) -> list[Pulse]:
        """Search what came since the last call; get the pulses found."""
        pulses: list[Pulse] = []
        with self._surviving():
            pulses = self._group.collect()
        bursts, self._bursts = self._bursts, []
        return self._marked(pulses + bursts)

    def _marked(self, pulses: list[Pulse]) -> list[Pulse]:
        """Mark the pulses that were clipped."""
        covers = self._clipped.covers
        return [
            replace(pulse, clipped=True)
            if covers(pulse.start_time_ns, pulse.end_time_ns)
            else pulse
            for pulse in pulses
        ]

    def _add(self, block: ChannelBlock) -> bool:
        """Make the detectors of a channel; False if it has no tags."""
        detectors = self._make(block)
        if detectors:
            self._group.add(block.channel, detectors)
        return bool(detectors)

    @contextmanager
    def _surviving(self) -> Iterator[None]:
        """Keep a failure in one tag's search from ending the others."""
        try:
            with self._watch:
                yield
        except Exception as error:
            tags = [detector.tag.tag_id for detector in self._group.last_searched]
            log.exception("search failed", tags=tags)
            self._restart(error)

    def _restart(self, error: Exception) -> None:
        """Rebuild all detectors after a failure; leave out a tag that failed twice."""
        suspects = [detector.tag for detector in self._group.last_searched]
        self.failures += 1
        # Which of several failed shows when each is searched alone; otherwise all are left out.
        if len(suspects) == 1 or all(tag.tag_id in self._alone for tag in suspects):
            for tag in suspects:
                self._faults[tag.tag_id] += 1
                if self._faults[tag.tag_id] >= FAULTS_OF_A_TAG:
                    self._leave_out(tag, error)
        self._alone |= {tag.tag_id for tag in suspects}
        self._group = DetectorGroup(self._receiver)
        self._group.alone = self._alone

    def _leave_out(self, tag: Tag, error: Exception) -> None:
        self.left_out[tag.tag_id] = tag
        name = f"{tag.tag_id} {tag.name}" if tag.name else f"{tag.tag_id}"
        log.error("tag no longer searched: its detector failed", tag=name, reason=str(error))

    def _finite(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Replace non-finite values by zeros, which would spoil the noise estimate for good."""
        if np.isfinite(samples.sum()):  # one sum shows it, and costs 2 µs
            return samples
        good = np.isfinite(samples)
        self.samples_invalid += int(np.count_nonzero(~good))
        return np.where(good, samples, np.complex64(0.0))

    @property
    def complete(self) -> bool:
        """Whether samples have come for every tag."""
        coded = sum(len(one.tags) for one in self._coded.values())
        return len(self.all()) + coded >= len(self._tags) - len(self.left_out)

    def flush(self) -> list[Pulse]:
        """Get the pulses in the samples so far."""
        pulses: list[Pulse] = []
        with self._surviving():
            pulses = self._group.flush()
        bursts = [pulse for coded in self._coded.values() for pulse in coded.flush()]
        return self._marked(pulses + bursts)

    def all(self) -> list[PulseDetector]:
        """All single-tag detectors made so far."""
        return self._group.detectors

    def search_reports(self) -> list[SearchReport]:
        """Take the detectors' reports on searches without a find."""
        return [report for one in self._searching() for report in one.search_reports()]

    def _searching(self) -> "list[PulseDetector | CodedDetector]":
        return [*self.all(), *self._coded.values()]

    def counters(self) -> dict[str, float]:
        """Sums of the counters of all detectors."""
        total: dict[str, float] = {
            "samples": self.samples,
            "samples_lost": self.samples_lost,
            # float64 holds a time of today to 0.3 µs.
            "last_sample_ns": float(self.last_sample_ns),
            "samples_invalid": self.samples_invalid,
            "detectors": len(self.all()),
            "detector_failures": self.failures,
            "tags_left_out": len(self.left_out),
        }
        for detector in self._searching():
            for name, count in _numbers(detector):
                total[name] = total.get(name, 0) + count
        return total

    def _of_channel(self, block: ChannelBlock) -> list[Tag]:
        """Find the tags of this channel that are still searched.

        A tag belongs to the channel with the nearest centre; a worker receives its tags'
        channels only.
        """
        half_spacing_hz = block.sample_rate_hz / 4
        return [
            tag
            for tag in self._tags
            if abs(tag.frequency_hz - block.center_frequency_hz) <= half_spacing_hz * 1.0001
            and tag.tag_id not in self.left_out
        ]

    def _make(self, block: ChannelBlock) -> list[PulseDetector]:
        """Make the detectors of this channel's beeping tags."""
        made = []
        for tag in self._of_channel(block):
            if tag.coded:
                continue
            try:
                detector = PulseDetector(
                    tag,
                    sample_rate_hz=block.sample_rate_hz,
                    center_frequency_hz=block.center_frequency_hz,
                    frequency_window_hz=self._settings.frequency_window_hz,
                    operating_mode=self._settings.operating_mode,
                )
            except (UavrtError, ArithmeticError, ValueError, MemoryError) as error:
                self.failures += 1
                self._leave_out(tag, error)  # it would be no better the next time
            else:
                made.append(detector)
        return made


def _numbers(detector: "PulseDetector | CodedDetector") -> Iterator[tuple[str, int]]:
    """All counters of a detector except samples, which the bank counts once."""
    counters = asdict(detector.counters)
    for reason, count in counters.pop("rejected").items():
        yield f"rejected_{reason}", count
    for name, count in counters.items():
        if name not in ("samples", "samples_lost"):
            yield name, count


def main() -> None:
    """Detect until stopped; then finish the samples that have arrived."""
    with ProcessFrame.start() as frame:
        assignment = frame.assignment
        receiver = ChannelReceiver(socket.socket(fileno=assignment.sample_fds[0]))
        bank = DetectorBank(assignment.tags, assignment.settings.detection, assignment.flight)
        searcher = Searcher(frame, bank)
        while frame.running:
            select.select([receiver.fileno(), frame.link.fileno()], [], [], SELECT_S)
            frame.receive()
            detect_all(searcher, receiver)
            searcher.report_health()
        detect_all(searcher, receiver)
        searcher.flush()
        searcher.finish()
        frame.report("stopped", counters=searcher.counters, last=True)


class Searcher:
    """Feeds blocks to a bank of detectors, and sends what it finds."""

    samples_dropped = 0
    """Samples dropped: none, since it waits for the search."""

    def __init__(self, frame: ProcessFrame, bank: DetectorBank) -> None:
        self._frame = frame
        self._bank = bank
        self._latencies = Latencies()
        self._time_ns: int | None = None
        """Time of the blocks not yet searched [ns]."""

    def send(self, block: ChannelBlock) -> None:
        """Add a channel's next block; the channels of one radio block are searched together."""
        if block.time_ns != self._time_ns:
            self._search()
            self._time_ns = block.time_ns
        self._bank.put(block)

    def _search(self) -> None:
        """Search the waiting blocks; send the pulses found."""
        if self._time_ns is None:
            return
        for pulse in self._bank.collect():
            self._frame.send("pulse", pulse)
        now_ns = self._frame.clock.now_ns()
        self._latencies.add((now_ns - self._bank.last_sample_ns) * 1e-9, now_ns * 1e-9)
        self._time_ns = None

    def flush(self) -> None:
        """Search the waiting blocks; send pulses and reports of searches without a find."""
        self._search()
        for report in self._bank.search_reports():
            self._frame.send("search_report", report)

    def finish(self) -> None:
        """Send the pulses in the remaining samples."""
        for pulse in self._bank.flush():
            self._frame.send("pulse", pulse)

    def report_health(self) -> None:
        """Send the health if it is due."""
        if not self._bank.complete:
            status = "waiting for samples"
        elif self._frame.clock.now_ns() - self._bank.last_sample_ns > LIVE_NS:
            status = "catching up"
        else:
            status = "detecting"
        self._frame.report(status, counters=self.counters)

    def counters(self) -> dict[str, float]:
        """Counters of the bank, and the latencies of searched samples."""
        return self._bank.counters() | self._latencies.counters()


def detect_all(searcher: Searcher, receiver: ChannelReceiver) -> None:
    """Search every waiting block and send the pulses found."""
    while blocks := receiver.receive():
        for block in blocks:
            searcher.send(block)
        # After a restart seconds of samples may wait here; it must not seem dead meanwhile.
        searcher.report_health()
    if receiver.complete:
        searcher.flush()


if __name__ == "__main__":
    main()
