"""Split a band into channels, sent as datagrams in the original UAV-RT's format.

This implements ``uavrt channelize``. It replaces ``airspy_channelize 375000 100`` in a chain of
the original's programs: ``airspy_rx | csdr | netcat`` send samples to it, and detectors receive
its datagrams.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import ConfigError
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.plan import channel_center_hz
from uavrt.radio.channels.channel_datagram import PortScheme, channel_port
from uavrt.radio.channels.channel_sender import ChannelDatagramSender
from uavrt.radio.source import SampleSource

ORIGINAL_CHANNELS: Final = 100
ORIGINAL_CHANNEL_RATE_HZ: Final = 3750.0
_POLL_S: Final = 0.25


@dataclass(slots=True)
class ChannelizeSummary:
    """Counters of one run of ``uavrt channelize``."""

    samples: int = 0
    samples_lost: int = 0
    datagrams: int = 0
    unheard: int = 0
    dropped: int = 0


def plan_channels(
    source: SampleSource, channels: Sequence[int], mode: Literal["default", "compatible"]
) -> FrontEnd:
    """Set up the filters of given channels, numbered as in the original UAV-RT, or all.

    A negative number means that the channel is also sent to its second port. `mode` selects the
    original's filter bank (3750 samples/s), or one that is twice oversampled and without
    aliases (7500 samples/s).
    """
    rate_hz, center_hz = source.sample_rate_hz, source.center_frequency_hz
    whole = FrontEnd(
        sample_rate_hz=rate_hz, center_frequency_hz=center_hz, frequencies_hz=(), mode=mode
    )
    if mode == "compatible":
        _check_compatible(whole)
    count, spacing_hz = whole.plan.channel_count, whole.plan.channel_spacing_hz
    for channel in channels:
        if not 1 <= abs(channel) <= count:
            raise ConfigError(
                f"there is no channel {channel}", remedy=f"Give numbers from 1 to {count}"
            )
    if not channels:
        return whole
    return FrontEnd(
        sample_rate_hz=rate_hz,
        center_frequency_hz=center_hz,
        frequencies_hz=[
            channel_center_hz(center_hz, abs(channel) - 1, count, spacing_hz)
            for channel in channels
        ],
        mode=mode,
    )


def _check_compatible(front_end: FrontEnd) -> None:
    """Raise `ConfigError` for settings that the original UAV-RT programs would misinterpret."""
    plan = front_end.plan
    count, rate_hz = plan.channel_count, plan.channel_rate_hz
    if count == ORIGINAL_CHANNELS and math.isclose(rate_hz, ORIGINAL_CHANNEL_RATE_HZ):
        return
    raise ConfigError(
        f"{plan.sample_rate_hz:g} samples a second give {count} channels of {rate_hz:g} Hz; "
        f"the detectors of the original UAV-RT need {ORIGINAL_CHANNELS} of "
        f"{ORIGINAL_CHANNEL_RATE_HZ:g} Hz",
        remedy="Use 375e3, 750e3, 1.5e6, 3e6 or 6e6 samples a second, or --mode default "
        "if the detectors have options for rate and centre frequency",
    )


def ports_of(
    front_end: FrontEnd, channels: Sequence[int], scheme: PortScheme
) -> dict[int, list[int]]:
    """UDP ports of each channel. Raises `ConfigError` if the scheme has no second port."""
    second = {abs(channel) - 1 for channel in channels if channel < 0}
    if second and scheme == "thesis":
        raise ConfigError(
            "--ports thesis gives each channel one port, but a channel with a minus sign "
            "needs two",
            remedy="Leave the minus sign out, or use --ports current",
        )
    return {
        channel: [
            channel_port(channel, scheme, second=is_second)
            for is_second in ((False, True) if channel in second else (False,))
        ]
        for channel in front_end.plan.channels_in_use
    }


def channelize(
    source: SampleSource,
    front_end: FrontEnd,
    sender: ChannelDatagramSender,
    *,
    speed: float = 1.0,
    pause: Callable[[float], None],
    should_stop: Callable[[], bool] = lambda: False,
    summary: ChannelizeSummary | None = None,
) -> ChannelizeSummary:
    """Send the channels until the source ends or the run is stopped.

    A file is played at `speed` times real time, because a faster sender would overflow the
    receiver's buffer; 0 means no limit. `summary` is updated during the run.
    """
    summary = ChannelizeSummary() if summary is None else summary
    begun_s: float | None = None
    while not should_stop():
        try:
            block = source.read(_POLL_S)
        except EOFError:
            break
        if block is None:
            continue
        begun_s = monotonic_s() if begun_s is None else begun_s
        summary.samples += len(block.samples)
        summary.samples_lost += block.lost_before
        for channel in front_end.process(block):
            sender.send(channel)
        summary.datagrams = sender.datagrams
        summary.unheard, summary.dropped = sender.unheard, sender.dropped
        if speed > 0.0:
            played_s = (summary.samples + summary.samples_lost) / block.sample_rate_hz
            ahead_s = played_s / speed - (monotonic_s() - begun_s)
            # A second ahead is in the listeners' buffers at most.
            if ahead_s > 1.0 / speed:
                pause(min(ahead_s, 1.0))
    return summary
