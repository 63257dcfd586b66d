"""The second stage in a separate process: from the decimated band to the tags' channels.

Used to compare shapes (`uavrt_experiments.resources.stages`). Its first socket receives the
band from the decimator; the others lead to the detectors.
"""

import itertools
import select
import socket
import time
from collections.abc import Iterator

import numpy as np

from uavrt.core.errors import UavrtError
from uavrt.core.messages import ChannelBlock, FlightInfo, IQBlock
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.sample_datagrams import ChannelReceiver, ChannelSender
from uavrt.drone.processes.samples.kept_channels import KeptChannels
from uavrt.dsp.frontend import FrontEnd

SELECT_S = 0.2
GATHER_S = 0.002
"""Wait for the rest of a radio block after its first datagram [s]."""
BAND_SAMPLES = 32_768
"""Number of band samples in a radio block of 87 ms."""


class BandSplitter:
    """Channelizes the band from one socket and sends the channels to others.

    `flight`: the flight in progress: frequency, rate and tags.
    """

    def __init__(self, frame: ProcessFrame, flight: FlightInfo) -> None:
        assignment = frame.assignment
        band_fd, *channel_fds = assignment.sample_fds
        self.band = ChannelReceiver(socket.socket(fileno=band_fd))
        self._senders = [ChannelSender(socket.socket(fileno=fd)) for fd in channel_fds]
        self._front_end = FrontEnd(
            sample_rate_hz=flight.sample_rate_hz,
            center_frequency_hz=flight.center_frequency_hz,
            frequencies_hz=[tag.frequency_hz for tag in flight.tags],
        )
        self._workers: dict[int, set[int]] = {}
        for tag in flight.tags:
            channel = self._front_end.channel_of(tag.frequency_hz)
            self._workers.setdefault(channel, set()).add(assignment.worker_of_tag[tag.tag_id])
        self._kept = KeptChannels(frame, flight)
        self.samples = self.samples_lost = 0

    def work(self) -> None:
        """Channelize all waiting samples."""
        for sender in self._senders:
            sender.flush()
        for band in self._bands():
            self.samples += len(band.samples)
            self.samples_lost += band.lost_before
            channels = self._front_end.channelize(band)
            self._kept.put(channels)
            for channel in channels:
                for worker in self._workers[channel.channel]:
                    self._senders[worker].send(channel)
            for sender in self._senders:
                sender.flush()

    def _bands(self) -> Iterator[IQBlock]:
        """Join waiting contiguous samples: a radio block comes in four datagrams."""
        parts: list[ChannelBlock] = []
        size = 0
        for block in itertools.chain.from_iterable(iter(self.band.receive, [])):
            follows = parts and block.sample_index == parts[0].sample_index + size
            if parts and (not follows or size >= BAND_SAMPLES):
                yield _joined(parts)
                parts, size = [], 0
            parts.append(block)
            size += len(block.samples)
        if parts:
            yield _joined(parts)

    def counters(self) -> dict[str, float]:
        """Numbers of received and lost samples, by name."""
        return {
            "band_samples": self.samples,
            "samples_lost": self.samples_lost,
            "channel_samples_dropped": sum(s.samples_dropped for s in self._senders),
            **self._kept.counters(),
        }

    def close(self) -> None:
        """Finish the recording of the channels."""
        self._kept.close()


def _joined(parts: list[ChannelBlock]) -> IQBlock:
    first = parts[0]
    return IQBlock(
        samples=np.concatenate([part.samples for part in parts]),
        sample_index=first.sample_index,
        time_ns=first.time_ns,
        sample_rate_hz=first.sample_rate_hz,
        lost_before=first.lost_before,
    )


def main() -> None:
    """Channelize until stopped; then finish the samples already received."""
    with ProcessFrame.start() as frame:
        flight = frame.assignment.flight
        if flight is None:
            raise UavrtError("the channelizer was started without a flight")
        splitter = BandSplitter(frame, flight)
        while frame.running:
            select.select([splitter.band.fileno(), frame.link.fileno()], [], [], SELECT_S)
            time.sleep(GATHER_S)
            frame.receive()
            splitter.work()
            status = "channelizing" if splitter.samples else "waiting for samples"
            frame.report(status, counters=splitter.counters)
        splitter.work()
        splitter.close()
        frame.report("stopped", counters=splitter.counters, last=True)


if __name__ == "__main__":
    main()
