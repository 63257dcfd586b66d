"""Send the channels of the tags to detectors of the original system.

uavrt's own channels are oversampled by two. The original detectors need 3750 samples a second
and the original channel numbers. So the decimated band is channelized a second time, in the
compatible mode. This takes 0.2 % of a core for one channel, 0.3 % for ten channels and 1.3 %
for all 100 channels (measured).
"""

from collections.abc import Mapping, Sequence

from uavrt.config.settings import UdpChannelSettings
from uavrt.core.messages import IQBlock, Tag
from uavrt.dsp.frontend import FrontEnd
from uavrt.radio.channels.channel_datagram import channel_port
from uavrt.radio.channels.channel_sender import ChannelDatagramSender


class ChannelOutput:
    """Channelizes a band for detectors of the original system and sends the tags' channels."""

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
        """Number of tags left out, because they are outside the original system's channels."""
        ports: dict[int, list[int]] = {}
        for tag in inside:
            channel = self._front_end.channel_of(tag.frequency_hz)
            places = ports.setdefault(channel, [channel_port(channel, settings.ports)])
            if len(tag.pulse_intervals_s) > 1 and settings.ports == "current":
                second = channel_port(channel, settings.ports, second=True)
                places += [second] * (second not in places)
        self.ports: Mapping[int, Sequence[int]] = ports
        """UDP ports to which each channel is sent; channels are numbered from 0."""
        self._sender = ChannelDatagramSender(
            ports if inside else {}, host=settings.host, style=settings.stamps
        )

    def process(self, band: IQBlock) -> None:
        """Channelize the next block of the decimated band and send the tags' channels."""
        if self.ports:
            for channel in self._front_end.process(band):
                self._sender.send(channel)

    def reset(self) -> None:
        """Reset the channelizer's filters after a failure of the radio."""
        self._front_end.reset()

    def counters(self) -> dict[str, float]:
        """Numbers of datagrams sent and dropped, for the health report."""
        return {
            "udp_channel_datagrams": self._sender.datagrams,
            "udp_channel_datagrams_dropped": self._sender.dropped,
        }

    def close(self) -> None:
        """Close the sockets that send the channels."""
        self._sender.close()
