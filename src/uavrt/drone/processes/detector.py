"""The detector process: finds the pulses of several tags in channel samples."""

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
from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import ChannelBlock, FlightInfo, Pulse, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.sample_datagrams import ChannelReceiver
from uavrt.drone.processes.samples.hang_watch import HangWatch
from uavrt.drone.processes.samples.latencies import Latencies
from uavrt.dsp.clipping import ClippedTimes

if TYPE_CHECKING:
    from uavrt.detection.coded.coded_detector import CodedDetector

log = get_logger()

FAILURES_PER_TAG = 2
"""Number of failures of a tag's search after which the tag is no longer searched."""
SELECT_S = 0.2
LIVE_NS = 1_500_000_000
"""Age from which samples count as backlog [ns], such as after a restart. Blocks and filters
alone delay samples by 0.2 s."""


class DetectorBank:
    """The detectors of all tags of a process, each created with the first block of its channel.

    A detector that fails or hangs must not disturb the search for other tags. All detectors are
    then created again, and the suspect tags are searched one at a time. A tag that fails twice
    is no longer searched.
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
        """Times with clipped samples in the last block [ns], equal for all its channels."""
        self._faults: Counter[int] = Counter()
        self.left_out: dict[int, Tag] = {}
        """Tags that are no longer searched, by tag number."""
        self.failures = 0
        self.samples = 0
        self.samples_lost = 0
        self.last_sample_ns = 0
        self.samples_invalid = 0

    def put(self, block: ChannelBlock) -> None:
        """Pass a sample block to the detectors of its channel; `collect` then searches it."""
        self.samples += len(block.samples)
        self.samples_lost += block.lost_before
        self.last_sample_ns = block.time_ns + round(
            len(block.samples) * NANOSECONDS_PER_SECOND / block.sample_rate_hz
        )
        if block.clipped_ns is not self._clipped_ns:
            self._clipped_ns = block.clipped_ns
            self._clipped.add(block.clipped_ns)
        with self._handle_failures():
            self._group.carriers_hz = block.carriers_hz
            if block.channel in self._group or self._add(block):
                self._group.put(block.channel, self._finite(block.samples), block.time_ns)
        self._put_coded(block)

    def _put_coded(self, block: ChannelBlock) -> None:
        codes = [tag for tag in self._of_channel(block) if tag.coded]
        if not codes:
            return
        try:
            if block.channel not in self._coded:
                # Loads scipy.special, 22 MB.
                from uavrt.detection.coded.coded_detector import CodedDetector

                self._coded[block.channel] = CodedDetector(
                    codes,
                    sample_rate_hz=block.sample_rate_hz,
                    center_frequency_hz=block.center_frequency_hz,
                    frequency_window_hz=self._settings.frequency_window_hz,
                )
            coded = self._coded[block.channel]
            self._bursts += coded.process(self._finite(block.samples), block.time_ns)
        except Exception as error:
            log.exception("search failed and restarts", tags=[tag.tag_id for tag in codes])
            self._coded.pop(block.channel, None)
            self.failures += 1
            for tag in codes:
                self._faults[tag.tag_id] += 1
                if self._faults[tag.tag_id] >= FAILURES_PER_TAG:
                    self._leave_out(tag, error)

    def collect(self) -> list[Pulse]:
        """Search the blocks added since the last call; return the pulses found."""
        pulses: list[Pulse] = []
        with self._handle_failures():
            pulses = self._group.collect()
        bursts, self._bursts = self._bursts, []
        return self._marked(pulses + bursts)

    def _marked(self, pulses: list[Pulse]) -> list[Pulse]:
        covers = self._clipped.covers
        return [
            replace(pulse, clipped=True)
            if covers(pulse.start_time_ns, pulse.end_time_ns)
            else pulse
            for pulse in pulses
        ]

    def _add(self, block: ChannelBlock) -> bool:
        detectors = self._make(block)
        if detectors:
            self._group.add(block.channel, detectors)
        return bool(detectors)

    @contextmanager
    def _handle_failures(self) -> Iterator[None]:
        """Context that catches an error of the search and restarts the detectors."""
        try:
            with self._watch:
                yield
        except Exception as error:
            tags = [detector.tag.tag_id for detector in self._group.last_searched]
            log.exception("search failed; detectors restart", tags=tags)
            self._restart(error)

    def _restart(self, error: Exception) -> None:
        """Create all detectors again after a failure; leave out a tag that has failed twice."""
        self.failures += 1
        for detector in self._group.last_searched:
            self._faults[detector.tag.tag_id] += 1
            if self._faults[detector.tag.tag_id] >= FAILURES_PER_TAG:
                self._leave_out(detector.tag, error)
        self._group = DetectorGroup(self._receiver)

    def _leave_out(self, tag: Tag, error: Exception) -> None:
        self.left_out[tag.tag_id] = tag
        name = f"{tag.tag_id} {tag.name}" if tag.name else f"{tag.tag_id}"
        log.error(
            "tag no longer searched for: its detector failed", tag=name, reason=str(error)
        )

    def _finite(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Replace non-finite samples by zeros, which do not corrupt the noise estimate."""
        if np.isfinite(samples.sum()):  # one sum shows it, and costs 2 µs
            return samples
        good = np.isfinite(samples)
        self.samples_invalid += int(np.count_nonzero(~good))
        return np.where(good, samples, np.complex64(0.0))

    @property
    def complete(self) -> bool:
        """True once each searched tag has received samples."""
        coded = sum(len(one.tags) for one in self._coded.values())
        return len(self.all()) + coded >= len(self._tags) - len(self.left_out)

    def flush(self) -> list[Pulse]:
        """End the search of the present samples; return the pulses found."""
        pulses: list[Pulse] = []
        with self._handle_failures():
            pulses = self._group.flush()
        bursts = [pulse for coded in self._coded.values() for pulse in coded.flush()]
        return self._marked(pulses + bursts)

    def all(self) -> list[PulseDetector]:
        """Return the detectors of uncoded tags whose channels have delivered samples."""
        return self._group.detectors

    def search_reports(self) -> list[SearchReport]:
        """Return the detectors' reports on time intervals without a detection."""
        return [report for one in self._searching() for report in one.search_reports()]

    def _searching(self) -> "list[PulseDetector | CodedDetector]":
        return [*self.all(), *self._coded.values()]

    def counters(self) -> dict[str, float]:
        """Sums of the counters of all detectors, for the health report."""
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
        """Return the tags of this process that are searched in the channel of this block."""
        half_spacing_hz = block.sample_rate_hz / 4
        return [
            tag
            for tag in self._tags
            if abs(tag.frequency_hz - block.center_frequency_hz) <= half_spacing_hz * 1.0001
            and tag.tag_id not in self.left_out
        ]

    def _make(self, block: ChannelBlock) -> list[PulseDetector]:
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
    counters = asdict(detector.counters)
    for reason, count in counters.pop("rejected").items():
        yield f"rejected_{reason}", count
    for name, count in counters.items():
        if name not in ("samples", "samples_lost"):
            yield name, count


def main() -> None:
    """Detect pulses until stopped; then search the samples that are still queued."""
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
    """Searches sample blocks with a bank of detectors, and sends the pulses found."""

    samples_dropped = 0
    """Number of dropped samples; always 0, because reading the radio waits for the search."""

    def __init__(self, frame: ProcessFrame, bank: DetectorBank) -> None:
        self._frame = frame
        self._bank = bank
        self._latencies = Latencies()
        self._time_ns: int | None = None
        """Start time of the blocks that are not yet searched [ns]."""

    def send(self, block: ChannelBlock) -> None:
        """Add one channel's block.

        The blocks of a radio block are searched together, once the next radio block begins.
        """
        if block.time_ns != self._time_ns:
            self._search()
            self._time_ns = block.time_ns
        self._bank.put(block)

    def _search(self) -> None:
        if self._time_ns is None:
            return
        for pulse in self._bank.collect():
            self._frame.send("pulse", pulse)
        now_ns = self._frame.clock.now_ns()
        self._latencies.add((now_ns - self._bank.last_sample_ns) * 1e-9, now_ns * 1e-9)
        self._time_ns = None

    def flush(self) -> None:
        """Search the added blocks; send pulses, and reports of searches without detection."""
        self._search()
        for report in self._bank.search_reports():
            self._frame.send("search_report", report)

    def finish(self) -> None:
        """End the search, and send the last pulses."""
        for pulse in self._bank.flush():
            self._frame.send("pulse", pulse)

    def report_health(self) -> None:
        """Send a health report if it is due."""
        if not self._bank.complete:
            status = "waiting for samples"
        elif self._frame.clock.now_ns() - self._bank.last_sample_ns > LIVE_NS:
            status = "catching up"
        else:
            status = "detecting"
        self._frame.report(status, counters=self.counters)

    def counters(self) -> dict[str, float]:
        """Counters of the detectors and age of searched samples, for the health report."""
        return self._bank.counters() | self._latencies.counters()


def detect_all(searcher: Searcher, receiver: ChannelReceiver) -> None:
    """Search all sample blocks that are queued, and send the pulses found."""
    while blocks := receiver.receive():
        for block in blocks:
            searcher.send(block)
        # After a restart seconds of samples may wait here; it must not seem dead meanwhile.
        searcher.report_health()
    if receiver.complete:
        searcher.flush()


if __name__ == "__main__":
    main()
