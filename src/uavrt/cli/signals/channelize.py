"""``uavrt channelize``: split a band into the original's channel datagrams."""

# isort: off
from uavrt.cli.shown.notices import notice
from uavrt.cli.options.kinds import Between, Hertz, HertzOrZero
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
import sys
import time
from contextlib import ExitStack, closing
from typing import Annotated, Literal

from cyclopts import Parameter

from uavrt.analysis.measure.channel_files import ChannelizeSummary, plan_channels, ports_of
from uavrt.analysis.measure.channel_files import channelize as run_channelizer
from uavrt.cli.options.inputs import Stated
from uavrt.cli.signals.detect import open_source, stop_on_signals
from uavrt.core.errors import ConfigError
from uavrt.radio.band_source import BandDatagramSource
from uavrt.radio.channels.channel_sender import ChannelDatagramSender
from uavrt.radio.source import SampleSource
from uavrt.radio.udp_address import is_udp_address

THESIS_RATE_HZ = 375_000.0


def channelize(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)] = "udp://localhost:10000",
    *,
    sample_rate: Hertz | None = None,
    center_frequency: HertzOrZero = 0.0,
    channels: Annotated[str, Parameter(allow_leading_hyphen=True)] = "",
    mode: Literal["compatible", "default"] = "compatible",
    ports: Literal["current", "thesis"] = "current",
    stamps: Literal["seconds", "milliseconds"] = "seconds",
    host: str = "127.0.0.1",
    format: str | None = None,
    start_time: str | None = None,
    speed: Annotated[float, Parameter(validator=Between(least=0))] = 1.0,
) -> None:
    """Split a band into channels and send each to a UDP port, as the original does.

    Replaces `airspy_channelize 375000 100`. Ctrl-C stops it.

    Parameters
    ----------
    source
        udp://localhost:10000 for what `… | netcat -u localhost 10000` sends, - for samples on
        standard input, or a recording.
    sample_rate
        Sample rate of the band; rates of 750e3 and above are decimated first (airspy_rx alone:
        3e6). By default as the recording states; 375e3 for UDP and standard input.
    center_frequency
        Centre of the band in hertz; the datagrams do not contain it.
    channels
        Channel numbers as the original counts them, separated by commas: 1 is the centre, 2 the
        next above, 100 the next below. A negative number also sends that channel to its second
        port. By default all.
    mode
        compatible: the original's filter, 100 channels of 3750 samples a second; other bands
        are refused. default: our filter for any band (7500 samples a second per channel at
        375e3), in which no frequency lies on a channel edge.
    ports
        current: 20000 + 2 × (channel - 1), second port + 1. thesis: 20000 + channel - 1.
    stamps
        seconds: as in the current original. milliseconds: as in the thesis.
    host
        Host that receives the datagrams.
    format
        Format of the file or of standard input: cf32, cs16, cu8, ci8, sigmf or wav.
    start_time
        Time of the first sample, ISO 8601, UTC; by default its arrival.
    speed
        Playback speed of a file, in multiples of real time; 0: as fast as it can be read.
    """
    numbers = _numbers(channels)
    stated = Stated(
        format=format,
        sample_rate=THESIS_RATE_HZ if source == "-" and sample_rate is None else sample_rate,
        center_frequency=center_frequency,
        start_time=start_time,
    ).options()
    opened: SampleSource
    if is_udp_address(source):
        opened = BandDatagramSource(
            source,
            sample_rate_hz=THESIS_RATE_HZ if sample_rate is None else sample_rate,
            center_frequency_hz=center_frequency,
            start_time_ns=stated["start_time_ns"],
        )
    else:
        opened = open_source(source, stated)
    summary = ChannelizeSummary()
    with ExitStack() as stack:
        stack.enter_context(closing(opened))
        should_stop = stack.enter_context(stop_on_signals())
        front_end = plan_channels(opened, numbers, mode)
        places = ports_of(front_end, numbers, ports)
        plan = front_end.plan
        sender = stack.enter_context(
            closing(ChannelDatagramSender(places, host=host, style=stamps))
        )
        notice(
            f"{len(places)} channels of {plan.channel_rate_hz:g} samples a second, "
            f"{plan.channel_spacing_hz:g} Hz apart, to {host} ports "
            f"{min(map(min, places.values()))} to {max(map(max, places.values()))}"
        )
        try:
            run_channelizer(
                opened,
                front_end,
                sender,
                speed=speed,
                pause=time.sleep,
                should_stop=lambda: should_stop() is not None,
                summary=summary,
            )
        finally:
            notice(_sentence(summary))
        number = should_stop()
    if number is not None:
        sys.exit(128 + number)


def _numbers(text: str) -> list[int]:
    try:
        return [int(part) for part in text.replace(",", " ").split()]
    except ValueError:
        raise ConfigError(
            f"--channels {text!r} is not a list of channel numbers",
            remedy="Give numbers separated by commas, such as 1,-46,100",
        ) from None


def _sentence(summary: ChannelizeSummary) -> str:
    return (
        f"{summary.samples} samples, {summary.samples_lost} lost; {summary.datagrams} datagrams"
        f" sent, {summary.unheard} without a receiver, {summary.dropped} dropped because "
        "the buffer was full"
    )
