"""The tags' channels for the original's detectors, in addition to ours.

Our channels are twice oversampled; the original's detectors need its own 3750 samples a second
and its channel numbers. So the decimated band is split again in the compatible mode: 0.2 % of a
core for one channel, 0.3 % for ten, 1.3 % for all hundred (measured here).
"""

from collections.abc import Mapping, Sequence

from uavrt.config.settings import UdpChannelSettings
from uavrt.dsp.frontend import FrontEnd
from uavrt.messages import IQBlock, Tag
from uavrt.radio.channel_datagram import channel_port
from uavrt.radio.channel_sender import ChannelDatagramSender


class ChannelOutput:
    """Sends the channels of tags to the original's ports.

    `settings`: destination and format. `tags`: whose channels; those beyond the original's band
    are left out. `band_rate_hz`, `center_frequency_hz`: of the decimated band. Raises
    `UavrtError` if no tag lies in the band, or it cannot be split.
    """

    def __init__(
        self,
        settings: UdpChannelSettings,
        tags: Sequence[Tag],
        *,
        band_rate_hz: float,
        center_frequency_hz: float,
    ) -> None:
        def front_end(frequencies_hz: Sequence[float]) -> FrontEnd:
            return FrontEnd(
                sample_rate_hz=band_rate_hz,
                center_frequency_hz=center_frequency_hz,
                frequencies_hz=frequencies_hz,
                mode="compatible",
            )

        half_span_hz = front_end(()).plan.usable_half_span_hz
        inside = [
            tag for tag in tags if abs(tag.frequency_hz - center_frequency_hz) <= half_span_hz
        ]
        self._front_end = front_end([tag.frequency_hz for tag in inside])
        self.left_out = len(tags) - len(inside)
        """Tags beyond the original's band."""
        ports: dict[int, list[int]] = {}
        for tag in inside:
            channel = self._front_end.channel_of(tag.frequency_hz)
            places = ports.setdefault(channel, [channel_port(channel, settings.ports)])
            if len(tag.pulse_intervals_s) > 1 and settings.ports == "current":
                second = channel_port(channel, settings.ports, second=True)
                places += [second] * (second not in places)
        self.ports: Mapping[int, Sequence[int]] = ports
        """Ports of each channel, numbered from 0."""
        self._sender = ChannelDatagramSender(
            ports if inside else {}, host=settings.host, style=settings.stamps
        )

    def process(self, band: IQBlock) -> None:
        """Process the next block of the decimated band."""
        if self.ports:
            for channel in self._front_end.process(band):
                self._sender.send(channel)

    def reset(self) -> None:
        """Reset the filters after the radio has failed."""
        self._front_end.reset()

    def counters(self) -> dict[str, float]:
        """Counters of the sender."""
        return {
            "udp_channel_datagrams": self._sender.datagrams,
            "udp_channel_datagrams_dropped": self._sender.dropped,
        }

    def close(self) -> None:
        """Close the sockets."""
        self._sender.close()
