"""The detector process: channel samples in, pulses of several tags out."""

import select
import socket
from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from uavrt.config.settings import DetectionSettings
from uavrt.detection import DetectorGroup, PulseDetector
from uavrt.ipc import ProcessFrame
from uavrt.ipc.samples import ChannelReceiver
from uavrt.messages import ChannelBlock, Pulse, Tag
from uavrt.processes.latencies import Latencies

SELECT_S = 0.2
LIVE_NS = 1_500_000_000
"""Samples older than this are not live: after a restart it works through what has waited.
Blocks of 87 ms and the filters take 0.2 s, a busy computer some more."""


class DetectorBank:
    """One `PulseDetector` for each tag, made when its channel's first block comes.

    Parameters
    ----------
    tags : tuple of Tag
        The tags this worker serves.
    settings : DetectionSettings
        How they are searched: window and operating mode.
    """

    def __init__(self, tags: tuple[Tag, ...], settings: DetectionSettings) -> None:
        self._tags = tags
        self._settings = settings
        self._group = DetectorGroup()
        self.samples = 0
        self.samples_lost = 0
        self.last_sample_ns = 0
        self.samples_invalid = 0

    def put(self, block: ChannelBlock) -> None:
        """Feed a block to the detectors of its channel; `collect` searches it."""
        self.samples += len(block.samples)
        self.samples_lost += block.lost_before
        self.last_sample_ns = block.time_ns + round(
            len(block.samples) * 1e9 / block.sample_rate_hz
        )
        if block.channel not in self._group:
            self._group.add(block.channel, self._make(block))
        self._group.put(block.channel, self._finite(block.samples), block.time_ns)

    def collect(self) -> list[Pulse]:
        """Search what came since the last call; get the pulses found."""
        return self._group.collect()

    def _finite(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Put zeros for what is no number: a noise level would never get rid of it."""
        if np.isfinite(samples.sum()):  # one number tells, and costs 2 µs
            return samples
        good = np.isfinite(samples)
        self.samples_invalid += int(np.count_nonzero(~good))
        return np.where(good, samples, np.complex64(0.0))

    @property
    def complete(self) -> bool:
        """Whether samples have come for every tag."""
        return len(self.all()) >= len(self._tags)

    def flush(self) -> list[Pulse]:
        """Get what the samples so far still hold."""
        return self._group.flush()

    def all(self) -> list[PulseDetector]:
        """Get every detector made so far."""
        return self._group.detectors

    def counters(self) -> dict[str, float]:
        """Count over all detectors."""
        total: dict[str, float] = {
            "samples": self.samples,
            "samples_lost": self.samples_lost,
            # float64 holds a time of today to 0.3 µs.
            "last_sample_ns": float(self.last_sample_ns),
            "samples_invalid": self.samples_invalid,
            "detectors": len(self.all()),
        }
        for detector in self.all():
            for name, count in _numbers(detector):
                total[name] = total.get(name, 0) + count
        return total

    def _make(self, block: ChannelBlock) -> list[PulseDetector]:
        """Make the detectors of the tags whose channel this is.

        The receiver sends this worker only the channels of its tags, and a tag belongs to the
        channel whose centre is nearest; neighbouring centres are half the rate apart at least.
        """
        half_spacing_hz = block.sample_rate_hz / 4
        nearest = [
            tag
            for tag in self._tags
            if abs(tag.frequency_hz - block.center_frequency_hz) <= half_spacing_hz * 1.0001
        ]
        return [
            PulseDetector(
                tag,
                sample_rate_hz=block.sample_rate_hz,
                center_frequency_hz=block.center_frequency_hz,
                frequency_window_hz=self._settings.frequency_window_hz,
                operating_mode=self._settings.operating_mode,
            )
            for tag in nearest
        ]


def _numbers(detector: PulseDetector) -> Iterator[tuple[str, int]]:
    """Everything a detector has counted, but the samples, which the bank counts once."""
    counters = asdict(detector.counters)
    for reason, count in counters.pop("rejected").items():
        yield f"rejected_{reason}", count
    for name, count in counters.items():
        if name not in ("samples", "samples_lost"):
            yield name, count


def main() -> None:
    """Detect until told to end; then finish the samples that are already here."""
    with ProcessFrame.start() as frame:
        assignment = frame.assignment
        receiver = ChannelReceiver(socket.socket(fileno=assignment.sample_fds[0]))
        bank = DetectorBank(assignment.tags, assignment.settings.detection)
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

    Parameters
    ----------
    frame : ProcessFrame
        The process.
    bank : DetectorBank
        The detectors of its tags.
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
        """Take the next block of a channel; the channels of one radio block belong together."""
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
        for detector in self._bank.all():
            for report in detector.search_reports():
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
