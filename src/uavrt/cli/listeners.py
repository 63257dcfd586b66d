"""Who else hears of a detection than the file of pulses: plots, and the original's programs."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.clock import monotonic_s
from uavrt.ipc.pulse_datagram import PulseDatagramSender
from uavrt.messages import ChannelBlock, Pulse, SearchReport, Tag
from uavrt.radio.udp_address import parse_udp_address

if TYPE_CHECKING:
    pass


class Listener:
    """Hears of everything; does nothing with it."""

    def channel(self, block: ChannelBlock) -> None:
        """Hear of a channel's samples."""

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Hear of pulses."""

    def reports(self, reports: Sequence[SearchReport]) -> None:
        """Hear of searches in vain; at least twice a second."""

    def finish(self) -> None:
        """Hear that it has ended well."""


class PulseDatagrams(Listener):
    """Sends pulses to the original's controller."""

    def __init__(self, address: str, tags: Sequence[Tag]) -> None:
        host, port = parse_udp_address(address)
        self._sender = PulseDatagramSender(host, port, [tag.tag_id for tag in tags])

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Send them."""
        self._sender.send_pulses(pulses)

    def reports(self, reports: Sequence[SearchReport]) -> None:
        """Send them, and a heartbeat when it is time."""
        self._sender.send_reports(reports)
        self._sender.heartbeat(monotonic_s())

    def close(self) -> None:
        """Close the socket."""
        self._sender.close()


class Plots(Listener):
    """Draws pictures at the end."""

    def __init__(
        self, directory: Path, tags: Sequence[Tag], frequency_window_hz: float
    ) -> None:
        from uavrt.analysis.plots import DetectionPlots

        self._plots: DetectionPlots = DetectionPlots(
            directory, tags, frequency_window_hz=frequency_window_hz
        )

    def channel(self, block: ChannelBlock) -> None:
        """Add to the waterfalls."""
        self._plots.add_block(block)

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Remember them."""
        self._plots.add_pulses(pulses)

    def finish(self) -> None:
        """Draw."""
        for path in self._plots.write():
            print(path, file=sys.stderr)
