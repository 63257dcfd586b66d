"""Convert the radio's samples to tag channels: decimator, channelizer, times, gaps.

All outputs are on one grid of absolute sample indices: band sample n is at input ``D n``,
channel sample n at band sample ``H n``. So neither a late start nor a gap shifts times or
phases. The group delays of the filters are subtracted from times.

A gap appears in the band as lost samples. The channelizer fills gaps of up to
`LONGEST_FILLED_GAP_S` with zeros; a longer one makes it start again, and is reported. Outputs
whose middle lies in a gap are set to zero, so that a detector finds the lost samples.
"""

import math
from collections.abc import Sequence

import numpy as np

from uavrt.core.errors import UsageError
from uavrt.core.messages import ChannelBlock, IQBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.dsp.channelizer import Channelizer
from uavrt.dsp.decimator import Decimator, Mode
from uavrt.dsp.plan import (
    ONE_CHANNEL_RATE_HZ,
    FrontEndPlan,
    channel_center_hz,
    check_rate,
    outside_span,
    plan_band,
)

LONGEST_FILLED_GAP_S = 1.0
"""Longest gap that is filled with zeros [s]; a longer one restarts the channelizer."""


class FrontEnd:
    """Decimate and channelize blocks of a radio.

    Parameters
    ----------
    sample_rate_hz : float
        Nominal rate of the radio or recording [Hz].
    center_frequency_hz : float
        Radio frequency at the middle of the band [Hz].
    frequencies_hz : sequence of float
        Frequencies of the tags [Hz]; each gets the channel whose centre is nearest. If
        empty, every channel of the band is computed.
    mode : {"default", "compatible"}
        See `Decimator` and `Channelizer`.

    Raises
    ------
    UsageError
        No plan supports this sample rate, or a number is not finite.
    TunerError
        A frequency lies outside the usable span; all of them are listed.
    """

    def __init__(
        self,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        frequencies_hz: Sequence[float],
        mode: Mode = "default",
    ) -> None:
        plan, self._decimator, self._channelizer = _set_up(
            float(sample_rate_hz), float(center_frequency_hz), frequencies_hz, mode
        )
        self.plan: FrontEndPlan = plan
        self.reset()

    def channel_of(self, frequency_hz: float) -> int:
        """Number of the channel whose centre is nearest to a frequency. Raises `TunerError`
        outside the usable span.
        """
        return self.plan.channel_of(frequency_hz)

    def reset(self) -> None:
        """Clear all stored samples; the next block is processed like the first."""
        self._next_input: int | None = None
        self._next_band: int | None = None
        self._next_output = 0
        self._next_channel_sample = 0
        self._lost_channel_samples = 0
        self._silent: list[tuple[int, int]] = []
        """First output sample of each gap, and the one after its last; gaps contain zeros."""

    def process(self, block: IQBlock) -> list[ChannelBlock]:
        """Decimate and channelize the next block; see `channelize`."""
        return self.channelize(self.decimate(block))

    def decimate(self, block: IQBlock) -> IQBlock:
        """Bring the next block to the rate of the band.

        Parameters
        ----------
        block : IQBlock
            Continues the previous block, or skips indices where samples were lost.

        Returns
        -------
        IQBlock
            A block of the band, perhaps empty. `time_ns`: first sample at the antenna, half the
            filter length before the input's. `lost_before`: counts samples of the band.
        """
        decimator = self._decimator
        if decimator is None:
            return block
        factor = decimator.factor
        lost = 0
        gap = None if self._next_input is None else block.sample_index - self._next_input
        if gap != 0:
            first = -(-block.sample_index // factor)
            if gap is None or not 0 < gap <= decimator.taps.size + factor:
                decimator.reset()
                fill = block.sample_index % factor
            else:
                fill = gap
            # Outputs within the gap contain no signal and are dropped, not sent as zeros.
            decimator.process(np.zeros(fill, dtype=np.complex64))
            if gap is not None:
                lost = max(0, first - self._next_output)
            self._next_output = first
        samples = decimator.process(block.samples)
        index = self._next_output
        self._next_output += samples.size
        self._next_input = block.sample_index + block.samples.size
        offset = index * factor - decimator.delay_samples - block.sample_index
        return IQBlock(
            samples=samples,
            sample_index=index,
            time_ns=_later(block, offset),
            sample_rate_hz=block.sample_rate_hz / factor,
            lost_before=lost,
        )

    def channelize(self, band: IQBlock) -> list[ChannelBlock]:
        """Split the next block of the band into the channels in use.

        Parameters
        ----------
        band : IQBlock
            As `decimate` returns it.

        Returns
        -------
        list of ChannelBlock
            One for each of ``plan.channels_in_use``, in that order, with equal times and
            lengths; none while the samples do not yet make one output.
        """
        bank = self._channelizer
        if bank is None:
            return self._as_one_channel(band)
        samples = band.samples
        gap = None if self._next_band is None else band.sample_index - self._next_band
        if gap is not None and gap > 0:
            low, high = (
                math.ceil((at + bank.delay_samples) / bank.hop)
                for at in (band.sample_index - gap, band.sample_index)
            )
            self._silent.append((low, high))
        if gap is None or gap < 0 or gap > LONGEST_FILLED_GAP_S * band.sample_rate_hz:
            bank.reset()
            bank.process(np.zeros(band.sample_index % bank.channels, dtype=np.complex64))
            first = band.sample_index // bank.hop
            if gap is not None:
                self._lost_channel_samples += max(0, first - self._next_channel_sample)
            self._next_channel_sample = first
        elif gap > 0:
            samples = np.concatenate((np.zeros(gap, dtype=np.complex64), samples))
        self._next_band = band.sample_index + band.samples.size
        channels = bank.process(samples)
        if channels.shape[1] == 0:
            return []
        index, lost = self._next_channel_sample, self._lost_channel_samples
        for low, high in self._silent:
            channels[:, max(low - index, 0) : max(high - index, 0)] = 0.0
        self._silent = [(a, b) for a, b in self._silent if b > index + channels.shape[1]]
        self._next_channel_sample += channels.shape[1]
        self._lost_channel_samples = 0
        offset = index * bank.hop - bank.delay_samples - band.sample_index
        time_ns = _later(band, offset)
        return [
            ChannelBlock(
                channel=channel,
                center_frequency_hz=center_hz,
                samples=row,
                sample_index=index,
                time_ns=time_ns,
                sample_rate_hz=band.sample_rate_hz / bank.hop,
                lost_before=lost,
            )
            for channel, center_hz, row in zip(
                self.plan.channels_in_use, self.plan.channel_centers_hz, channels, strict=True
            )
        ]

    def _as_one_channel(self, band: IQBlock) -> list[ChannelBlock]:
        # Unfiltered samples are still in the source's buffer, which the source overwrites.
        samples = band.samples.copy() if self._decimator is None else band.samples
        return [
            ChannelBlock(
                channel=0,
                center_frequency_hz=self.plan.center_frequency_hz,
                samples=samples,
                sample_index=band.sample_index,
                time_ns=band.time_ns,
                sample_rate_hz=band.sample_rate_hz,
                lost_before=band.lost_before,
            )
        ]


def _later(block: IQBlock, samples: float) -> int:
    return block.time_ns + round(samples * NANOSECONDS_PER_SECOND / block.sample_rate_hz)


def _set_up(
    sample_rate_hz: float,
    center_frequency_hz: float,
    frequencies_hz: Sequence[float],
    mode: Mode,
) -> tuple[FrontEndPlan, Decimator | None, Channelizer | None]:
    check_rate(sample_rate_hz)
    frequencies = tuple(float(frequency) for frequency in frequencies_hz)
    for frequency in (center_frequency_hz, *frequencies):
        if not np.isfinite(frequency):
            raise UsageError(
                f"the frequency {frequency} Hz is not finite",
                remedy="Give frequencies in hertz",
            )
    reach = max((abs(f - center_frequency_hz) for f in frequencies), default=0.0)
    one_channel = sample_rate_hz <= ONE_CHANNEL_RATE_HZ
    layout = plan_band(sample_rate_hz, reach_hz=reach, mode=mode)
    factor, band_rate = layout.decimation_factor, layout.band_rate_hz
    half_span = sample_rate_hz / 2 if one_channel else layout.usable_half_span_hz
    outside = [f for f in frequencies if abs(f - center_frequency_hz) > half_span]
    if outside:
        raise outside_span(outside, center_frequency_hz, half_span)

    count, spacing = layout.channel_count, layout.channel_spacing_hz
    channels = tuple(
        round((frequency - center_frequency_hz) / spacing) % count for frequency in frequencies
    )
    in_use = tuple(sorted(set(channels))) if channels else tuple(range(count))
    decimator = (
        Decimator(factor=factor, sample_rate_hz=sample_rate_hz, mode=mode)
        if factor > 1
        else None
    )
    bank = (
        Channelizer(channels=count, sample_rate_hz=band_rate, mode=mode, in_use=in_use)
        if count > 1
        else None
    )
    plan = FrontEndPlan(
        mode=mode,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=center_frequency_hz,
        decimation_factor=factor,
        band_rate_hz=band_rate,
        channel_count=count,
        channel_spacing_hz=spacing,
        channel_rate_hz=bank.channel_rate_hz if bank else band_rate,
        usable_half_span_hz=half_span,
        frequencies_hz=frequencies,
        frequency_channels=channels,
        channels_in_use=in_use,
        channel_centers_hz=tuple(
            channel_center_hz(center_frequency_hz, channel, count, spacing)
            for channel in in_use
        ),
        latency_s=(decimator.latency_s if decimator else 0.0)
        + (bank.latency_s if bank else 0.0),
    )
    return plan, decimator, bank
