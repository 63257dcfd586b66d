"""Find coded tags in a recording: bursts that come again and again with the same gaps.

Pulses are found by themselves, since whoever measures a tag has it near by. Those that follow
each other within a quarter of a second are a burst; bursts with as many pulses and the same
gaps are one tag, and the times of its bursts tell the burst interval.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.interval_fit import Beat, fit_beat
from uavrt.config import GAP_TOLERANCE_S
from uavrt.detection.coded import Cells
from uavrt.dsp import FrontEnd
from uavrt.errors import UavrtError
from uavrt.messages import Tag
from uavrt.radio import BlockTimes, SampleSource

LONGEST_PULSE_S: Final = 0.006
"""Pulses of coded tags are short: 2.5 ms; those that beep have 8 ms and more."""
_WIDTH_S: Final = 0.0025
_LEAST: Final = 30.0
"""Of a pulse's energy over that of noise: 15 dB."""
_APART_S: Final = 0.25
"""Pulses further apart are of two bursts."""
_FEWEST: Final = 3
"""Bursts with the same gaps."""
_MOST_PULSES: Final = 8
_OFF_BEAT_S: Final = 0.008
"""Bursts are so near to whole numbers of the burst interval, or are no tag's."""
_MOST_LOST: Final = 4
"""Intervals in the shortest time between two bursts that were heard."""
_AT_ONCE: Final = 4
"""Channels of a recording that are held in memory: ten minutes take some 30 MB."""
_WINDOW_HZ: Final = 1000.0
_MOST_S: Final = 600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredCode:
    """A coded tag as a recording shows it; each sigma is one standard deviation."""

    frequency_hz: float
    gaps_s: tuple[float, ...]
    gaps_sigma_s: tuple[float, ...]
    burst_interval_s: float
    burst_interval_sigma_s: float
    bursts: int

    def entry(self, tag_id: int, name: str | None = None) -> Tag:
        """Make a tag entry, with the tolerances of the trade."""
        return Tag(
            tag_id=tag_id,
            frequency_hz=float(round(self.frequency_hz)),
            pulse_width_s=_WIDTH_S,
            pulse_intervals_s=(round(self.burst_interval_s, 4),),
            interval_uncertainty_s=max(
                0.004, math.ceil(3e3 * self.burst_interval_sigma_s) / 1e3
            ),
            k=10,
            gaps_s=tuple(round(gap_s, 5) for gap_s in self.gaps_s),
            name=name,
        )


def may_be_bursts(times_s: NDArray[np.float64]) -> bool:
    """Whether pulses, ascending, come by twos or more, as often as a code needs."""
    return len(_split(times_s)) >= _FEWEST


def measure_codes(
    open_source: Callable[[], SampleSource], frequencies_hz: Sequence[float]
) -> tuple[MeasuredCode, ...]:
    """Find coded tags near some frequencies, the one with the most bursts first.

    Parameters
    ----------
    open_source : callable
        Opens the recording; called once for some frequencies.
    frequencies_hz : sequence of float
        Where short pulses were seen, what matters most first: a code's neighbours within 1 kHz
        are its own pulses.

    Raises
    ------
    UavrtError
        The recording cannot be read.
    """
    apart: list[float] = []
    for frequency_hz in frequencies_hz:
        if all(abs(frequency_hz - other_hz) >= 0.5 * _WINDOW_HZ for other_hz in apart):
            apart.append(frequency_hz)
    found: list[MeasuredCode] = []
    for first in range(0, len(apart), _AT_ONCE):
        some_hz = apart[first : first + _AT_ONCE]
        with closing(open_source()) as source:
            pulses = _pulses(source, some_hz)
        for frequency_hz, times_s in zip(some_hz, pulses, strict=True):
            if all(abs(frequency_hz - one.frequency_hz) >= _WINDOW_HZ for one in found):
                found += _codes(times_s, frequency_hz)
    return tuple(sorted(found, key=lambda code: -code.bursts))


def _split(times_s: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Put pulses together to bursts."""
    bursts = np.split(times_s, np.flatnonzero(np.diff(times_s) > _APART_S) + 1)
    return [one for one in bursts if 2 <= len(one) <= _MOST_PULSES]


def _codes(times_s: NDArray[np.float64], frequency_hz: float) -> list[MeasuredCode]:
    left = _split(times_s)
    found = []
    while left:
        first = np.diff(left[0])
        same = [one for one in left if len(one) == len(left[0])]
        same = [one for one in same if np.abs(np.diff(one) - first).sum() <= GAP_TOLERANCE_S]
        alike = {id(one) for one in same}
        left = [one for one in left if id(one) not in alike]
        if len(same) >= _FEWEST and (code := _code(same, frequency_hz)) is not None:
            found.append(code)
    return found


def _code(bursts: list[NDArray[np.float64]], frequency_hz: float) -> MeasuredCode | None:
    """Measure bursts of the same gaps; None where they keep no beat, as chance's do not."""
    starts_s = np.array([one[0] for one in bursts])
    beat = _beat(starts_s)
    if beat is None:
        return None
    gaps_s = np.array([np.diff(one) for one in bursts])
    return MeasuredCode(
        frequency_hz=frequency_hz,
        gaps_s=tuple(gaps_s.mean(axis=0).tolist()),
        gaps_sigma_s=tuple((gaps_s.std(axis=0, ddof=1) / math.sqrt(len(bursts))).tolist()),
        burst_interval_s=beat.interval_s,
        burst_interval_sigma_s=beat.sigma_s,
        bursts=len(bursts),
    )


def _beat(starts_s: NDArray[np.float64]) -> Beat | None:
    """Fit the longest interval that bursts are whole numbers of.

    Where every second burst is lost, the shortest time between two is more than one interval.
    """
    shortest_s = float(np.diff(starts_s).min())
    for part in range(1, _MOST_LOST + 1):
        if shortest_s / part < _APART_S:
            break
        beat = fit_beat(starts_s, shortest_s / part)
        off_s = np.abs(beat.residuals_s)
        kept = off_s <= max(3.0 * float(np.median(off_s)), _OFF_BEAT_S)
        if kept.sum() >= max(_FEWEST, 0.75 * len(starts_s)):
            beat = fit_beat(starts_s[kept], beat.interval_s)
            if beat.scatter_s <= _OFF_BEAT_S:
                return beat
    return None


def _pulses(source: SampleSource, frequencies_hz: Sequence[float]) -> list[NDArray[np.float64]]:
    """Starts of the strong pulses near each frequency [s from some time]."""
    front_end = FrontEnd(
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=source.center_frequency_hz,
        frequencies_hz=list(frequencies_hz),
    )
    parts: dict[int, list[NDArray[np.complex64]]] = {}
    rate_hz = front_end.plan.channel_rate_hz
    centers_hz: dict[int, float] = {}
    times = BlockTimes(rate_hz)
    samples = taken = 0
    while samples < _MOST_S * source.sample_rate_hz:
        try:
            block = source.read()
        except EOFError:
            break
        except UavrtError:
            if not samples:
                raise
            break  # a recording that was cut off is measured as far as it goes
        if block is None:
            continue
        samples += len(block.samples)
        channels = front_end.process(block)
        for one in channels:
            centers_hz[one.channel] = one.center_frequency_hz
            # A band that is one channel hands on the source's own buffer.
            parts.setdefault(one.channel, []).append(one.samples.copy())
        if channels:  # all of equal times and lengths
            times.add(taken, channels[0].time_ns)
            taken += len(channels[0].samples)
    joined = {channel: np.concatenate(held) for channel, held in parts.items()}
    found = []
    for frequency_hz, channel in zip(
        frequencies_hz, front_end.plan.frequency_channels, strict=True
    ):
        starts = np.zeros(0)
        if channel in joined:
            offset_hz = frequency_hz - centers_hz[channel]
            starts = rate_hz * _starts(joined[channel], rate_hz, offset_hz)
            starts = np.sort(times.seconds(starts, times.start_ns))
        found.append(starts)
    return found


def _starts(
    samples: NDArray[np.complex64], rate_hz: float, offset_hz: float
) -> NDArray[np.float64]:
    cells = Cells(
        sample_rate_hz=rate_hz,
        pulse_width_s=_WIDTH_S,
        low_hz=max(offset_hz - _WINDOW_HZ, -0.5 * rate_hz),
        high_hz=min(offset_hz + _WINDOW_HZ, 0.5 * rate_hz),
        kept_s=0.1,
        recent_s=1.0,
    )
    step = round(rate_hz)
    rows = [np.zeros(0, np.float32)]
    while count := cells.push(samples[cells.end * cells.hop :][:step]):
        rows.append(cells.recent[:, -count:].max(axis=0))
    energy = np.concatenate(rows).astype(np.float64)
    reach = cells.pulse
    tall = np.lib.stride_tricks.sliding_window_view(np.pad(energy, reach), 2 * reach + 1)
    top = np.flatnonzero((energy >= _LEAST) & (energy == tall.max(axis=1)))
    top = top[(top >= reach) & (top < len(energy) - reach)]
    # The filter falls off linearly to both sides: amplitudes tell where between columns.
    near = max(1, reach // 3)
    left, right = np.sqrt(energy[top - near]), np.sqrt(energy[top + near])
    shift = 0.5 * reach * (right - left) / np.sqrt(energy[top])
    return np.asarray((top + np.clip(shift, -1.0, 1.0)) * cells.column_s, np.float64)
