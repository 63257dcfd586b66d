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
"""So often a detector may fail before its tag is left out: the first may have been chance."""
SELECT_S = 0.2
LIVE_NS = 1_500_000_000
"""Samples older than this are not live: after a restart it works through what has waited.
Blocks of 87 ms and the filters take 0.2 s, a busy computer some more."""


class DetectorBank:
    """One `PulseDetector` for each tag, made when its channel's first block comes.

    A detector that fails or hangs must not cost the others their pulses. All are made anew,
    since the search of many is one; those that had their turn then are searched alone from
    there on, and a tag at which the search fails twice is left out, told by its name.

    `tags`: the tags this worker serves.
    `settings`: how they are searched: window and operating mode.
    `flight`: what the radio is set to: ghosts that it makes of a strong tag are not confirmed.
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
        self._watch = HangWatch(lambda: self._group.in_hand)
        self._clipped = ClippedTimes()
        self._clipped_ns: tuple[tuple[int, int], ...] = ()
        """Taken last; the channels of a radio block have the same."""
        self._faults: Counter[int] = Counter()
        self._alone: frozenset[int] = frozenset()
        self.left_out: dict[int, Tag] = {}
        """Tags that are not searched any more, by id."""
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
        """Search a block for coded tags; if that fails twice they are left out."""
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
        """Make the detectors of a channel; False when it has none."""
        detectors = self._make(block)
        if detectors:
            self._group.add(block.channel, detectors)
        return bool(detectors)

    @contextmanager
    def _surviving(self) -> Iterator[None]:
        """Keep a failure of one tag's search from ending the others."""
        try:
            with self._watch:
                yield
        except Exception as error:
            tags = [detector.tag.tag_id for detector in self._group.in_hand]
            log.exception("search failed", tags=tags)
            self._start_anew(error)

    def _start_anew(self, error: Exception) -> None:
        """Continue without what failed: with new detectors, and finally without the tag."""
        suspects = [detector.tag for detector in self._group.in_hand]
        self.failures += 1
        # Of several, one: they are told apart alone, or all go where that is not possible.
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
        log.error("tag is searched no more: its detector failed", tag=name, reason=str(error))

    def _finite(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Replace values that are not numbers by zeros: the noise level would never recover."""
        if np.isfinite(samples.sum()):  # one number tells, and costs 2 µs
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
        """Get what the samples so far still hold."""
        pulses: list[Pulse] = []
        with self._surviving():
            pulses = self._group.flush()
        bursts = [pulse for coded in self._coded.values() for pulse in coded.flush()]
        return self._marked(pulses + bursts)

    def all(self) -> list[PulseDetector]:
        """Get every detector of a single tag made so far."""
        return self._group.detectors

    def search_reports(self) -> list[SearchReport]:
        """Take what all detectors have searched in vain."""
        return [report for one in self._searching() for report in one.search_reports()]

    def _searching(self) -> "list[PulseDetector | CodedDetector]":
        return [*self.all(), *self._coded.values()]

    def counters(self) -> dict[str, float]:
        """Count over all detectors."""
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
        """Find the tags whose channel this is, and that are not left out.

        The receiver sends this worker only the channels of its tags, and a tag belongs to the
        channel whose centre is nearest; neighbouring centres are half the rate apart at least.
        """
        half_spacing_hz = block.sample_rate_hz / 4
        return [
            tag
            for tag in self._tags
            if abs(tag.frequency_hz - block.center_frequency_hz) <= half_spacing_hz * 1.0001
            and tag.tag_id not in self.left_out
        ]

    def _make(self, block: ChannelBlock) -> list[PulseDetector]:
        """Make the detectors of the beeping tags whose channel this is."""
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
    """Everything a detector has counted, but the samples, which the bank counts once."""
    counters = asdict(detector.counters)
    for reason, count in counters.pop("rejected").items():
        yield f"rejected_{reason}", count
    for name, count in counters.items():
        if name not in ("samples", "samples_lost"):
            yield name, count


def main() -> None:
    """Detect until told to stop; then finish the samples that are already here."""
    with ProcessFrame.start() as frame:
        assignment = frame.assignment
        receiver = ChannelReceiver(socket.socket(fileno=assignment.sample_fds[0]))
        bank = DetectorBank(assignment.tags, assignment.settings.detection, assignment.flight)
        searcher = Searcher(frame, bank)
        while frame.running:
            select.select([receiver.fileno(), frame.link.fileno()], [], [], SELECT_S)
            frame.receive()
            detect_all(searcher, receiver)
            searcher.tell_health()
        detect_all(searcher, receiver)
        searcher.flush()
        searcher.finish()
        frame.report("stopped", counters=searcher.counters, last=True)


class Searcher:
    """Gives blocks to a bank of detectors, and sends what it finds.

    `bank`: the detectors of its tags.
    """

    samples_dropped = 0
    """It takes what it gets."""

    def __init__(self, frame: ProcessFrame, bank: DetectorBank) -> None:
        self._frame = frame
        self._bank = bank
        self._latencies = Latencies()
        self._time_ns: int | None = None
        """Of the blocks that are yet to be searched."""

    def send(self, block: ChannelBlock) -> None:
        """Process a channel's next block; the channels of one radio block belong together."""
        if block.time_ns != self._time_ns:
            self._search()
            self._time_ns = block.time_ns
        self._bank.put(block)

    def _search(self) -> None:
        """Search the blocks that came; send what was found."""
        if self._time_ns is None:
            return
        for pulse in self._bank.collect():
            self._frame.send("pulse", pulse)
        now_ns = self._frame.clock.now_ns()
        self._latencies.add((now_ns - self._bank.last_sample_ns) * 1e-9, now_ns * 1e-9)
        self._time_ns = None

    def flush(self) -> None:
        """Search what came; send what was found, and what was searched in vain."""
        self._search()
        for report in self._bank.search_reports():
            self._frame.send("search_report", report)

    def finish(self) -> None:
        """Send what the samples so far still hold."""
        for pulse in self._bank.flush():
            self._frame.send("pulse", pulse)

    def tell_health(self) -> None:
        """Send the health if it is due."""
        if not self._bank.complete:
            status = "waiting for samples"
        elif self._frame.clock.now_ns() - self._bank.last_sample_ns > LIVE_NS:
            status = "catching up"
        else:
            status = "detecting"
        self._frame.report(status, counters=self.counters)

    def counters(self) -> dict[str, float]:
        """Count, and say how old the samples were when they had been searched."""
        return self._bank.counters() | self._latencies.counters()


def detect_all(searcher: Searcher, receiver: ChannelReceiver) -> None:
    """Process every block that waits and send what was found."""
    while blocks := receiver.receive():
        for block in blocks:
            searcher.send(block)
        # After a restart seconds of samples may wait here; it must not seem dead meanwhile.
        searcher.tell_health()
    if receiver.complete:
        searcher.flush()


if __name__ == "__main__":
    main()
