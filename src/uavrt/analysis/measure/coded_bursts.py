"""Find coded tags in a recording: bursts of pulses that repeat with the same gaps.

Each pulse is detected separately, which is possible because the tag to be measured is near.
Pulses within a quarter of a second form a burst. Bursts with equal gaps belong to one tag, and
their times give the burst interval.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.config.tags.code_rules import GAP_TOLERANCE_S
from uavrt.core.messages import ChannelBlock, Tag
from uavrt.detection.beeps.beep_trains import split_bursts
from uavrt.detection.beeps.interval_fit import Beat, fit_beat
from uavrt.detection.beeps.tuning import TRAINS
from uavrt.detection.coded.slot_cells import Cells
from uavrt.dsp.block_times import BlockTimes

LONGEST_PULSE_S: Final = 0.006
"""Pulse width up to which a tag may be coded [s]; pulses of uncoded tags are 8 ms or longer."""
_WIDTH_S: Final = 0.0025
"""Length of the filter that detects pulses [s], equal to a coded tag's usual pulse width.
Pulses up to 7.5 ms wide are found."""
_REACH_S: Final = 0.009
"""Half-width of the time around a pulse with which its energy is compared [s]; gaps between
pulses are longer."""
_WIDTH_STEPS_PER_S: Final = 2000.0
"""Inverse of the rounding step of pulse widths [1/s]: 0.5 ms, as in data sheets."""
_LEAST: Final = 30.0
"""Minimum ratio of a coded pulse's energy to the mean energy of the noise, 30 (15 dB)."""
_PEAKED: Final = 4.0
"""Minimum ratio of a coded pulse's energy at its frequency to the median energy within 1
kHz."""
_OFF_BEAT_S: Final = 0.008
"""Largest deviation of a burst's start from a multiple of the burst interval [s]."""
_MOST_LOST: Final = 4
"""Maximum number of burst intervals between the two nearest received bursts."""
_WINDOW_HZ: Final = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredCode:
    """Measured gaps and burst interval of a coded tag; each sigma is one standard deviation."""

    frequency_hz: float
    gaps_s: tuple[float, ...]
    gaps_sigma_s: tuple[float, ...]
    pulse_width_s: float
    """Median pulse width [s]; the first pulse of a burst may be longer."""
    burst_interval_s: float
    burst_interval_sigma_s: float
    bursts: int

    def entry(self, tag_id: int, name: str | None = None) -> Tag:
        """Return a tag list entry with the measured values and the usual tolerances."""
        return Tag(
            tag_id=tag_id,
            frequency_hz=float(round(self.frequency_hz)),
            pulse_width_s=round(self.pulse_width_s * _WIDTH_STEPS_PER_S) / _WIDTH_STEPS_PER_S,
            pulse_intervals_s=(round(self.burst_interval_s, 4),),
            interval_uncertainty_s=max(
                0.004, math.ceil(3e3 * self.burst_interval_sigma_s) / 1e3
            ),
            k=10,
            gaps_s=tuple(round(gap_s, 5) for gap_s in self.gaps_s),
            name=name,
        )


def find_codes(
    times_s: NDArray[np.float64], widths_s: NDArray[np.float64], frequency_hz: float
) -> list[MeasuredCode]:
    """Find coded tags among pulses at one frequency, given the pulses' times and widths [s]."""
    left = split_bursts(times_s)
    found = []
    while left:
        first = np.diff(left[0])
        same = [one for one in left if len(one) == len(left[0])]
        same = [one for one in same if np.abs(np.diff(one) - first).sum() <= GAP_TOLERANCE_S]
        alike = {id(one) for one in same}
        left = [one for one in left if id(one) not in alike]
        if len(same) >= TRAINS.fewest_bursts:
            middles_s = np.array(same)
            lengths_s = widths_s[np.searchsorted(times_s, middles_s)]
            if (code := _code(middles_s, lengths_s, frequency_hz)) is not None:
                found.append(code)
    return found


def _code(
    middles_s: NDArray[np.float64], widths_s: NDArray[np.float64], frequency_hz: float
) -> MeasuredCode | None:
    """Measure a code from bursts with equal gaps, one per row; None if irregular.

    Gaps are measured between the pulses' middles, which are more accurate than their starts.
    They are then corrected for the mean width of each pulse in the burst.
    """
    beat = _beat(middles_s[:, 0])
    if beat is None:
        return None
    gaps_s = np.diff(middles_s - 0.5 * widths_s.mean(axis=0))
    return MeasuredCode(
        frequency_hz=frequency_hz,
        gaps_s=tuple(gaps_s.mean(axis=0).tolist()),
        gaps_sigma_s=tuple((gaps_s.std(axis=0, ddof=1) / math.sqrt(len(gaps_s))).tolist()),
        pulse_width_s=float(np.median(widths_s)),
        burst_interval_s=beat.interval_s,
        burst_interval_sigma_s=beat.sigma_s,
        bursts=len(gaps_s),
    )


def _beat(starts_s: NDArray[np.float64]) -> Beat | None:
    """Fit the longest burst interval that divides all times between bursts; None if there is
    none.

    If every second burst is lost, the shortest time between two bursts contains more than one
    interval.
    """
    shortest_s = float(np.diff(starts_s).min())
    for part in range(1, _MOST_LOST + 1):
        if shortest_s / part < TRAINS.burst_gap_s:
            break
        beat = fit_beat(starts_s, shortest_s / part)
        off_s = np.abs(beat.residuals_s)
        kept = off_s <= max(3.0 * float(np.median(off_s)), _OFF_BEAT_S)
        if kept.sum() >= max(TRAINS.fewest_bursts, 0.75 * len(starts_s)):
            beat = fit_beat(starts_s[kept], beat.interval_s)
            if beat.scatter_s <= _OFF_BEAT_S:
                return beat
    return None


class BurstPulses:
    """Finds the pulses of a coded tag at a given frequency in a channel's samples."""

    def __init__(self, frequency_hz: float, rate_hz: float) -> None:
        self._frequency_hz = frequency_hz
        self._rate_hz = rate_hz
        self._times = BlockTimes(rate_hz)
        self._cells: Cells | None = None
        self._held = np.zeros(0, np.complex64)
        self._taken = 0
        self._rows = [np.zeros(0, np.float32)]

    def process(self, block: ChannelBlock) -> None:
        """Process the next block of the channel's samples."""
        if self._cells is None:
            offset_hz = self._frequency_hz - block.center_frequency_hz
            self._cells = Cells(
                sample_rate_hz=self._rate_hz,
                pulse_width_s=_WIDTH_S,
                low_hz=max(offset_hz - _WINDOW_HZ, -0.5 * self._rate_hz),
                high_hz=min(offset_hz + _WINDOW_HZ, 0.5 * self._rate_hz),
                kept_s=0.1,
                recent_s=1.1,
            )
        self._times.add(self._taken, block.time_ns)
        self._taken += len(block.samples)
        self._held = np.concatenate((self._held, block.samples))
        while len(self._held) >= self._rate_hz:
            self._push(self._cells)

    def _push(self, cells: Cells) -> None:
        if count := cells.push(self._held[: round(self._rate_hz)]):
            energy = cells.recent[:, -count:]
            most = energy.max(axis=0)
            # An impulse has as much energy at all frequencies.
            flat = most < _PEAKED * np.median(energy, axis=0)
            self._rows.append(np.where(flat, np.float32(0.0), most))
            self._held = self._held[count * cells.hop :]

    def finish(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles [s from the first sample] and widths [s] of the strong pulses, by time."""
        if self._cells is None:
            return np.zeros(0), np.zeros(0)
        self._push(self._cells)
        middles_s, widths_s = _pulses(np.concatenate(self._rows), self._cells)
        times_s = self._times.seconds(self._rate_hz * middles_s, self._times.start_ns)
        return np.sort(times_s), widths_s


def _pulses(
    energies: NDArray[np.float32], cells: Cells
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middle and width [s] of each pulse, at half its height in the filter's output.

    At the filter's output, the amplitude of a rectangular pulse rises and falls linearly.
    """
    amplitude = np.sqrt(np.pad(energies.astype(np.float64), 1))
    reach = round(_REACH_S / cells.column_s)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(amplitude, reach), 2 * reach + 1)
    half = 0.5 * around.max(axis=1)
    up = np.flatnonzero((amplitude >= half) & (half >= 0.5 * math.sqrt(_LEAST)))
    if not up.size:
        return np.zeros(0), np.zeros(0)
    cuts = np.flatnonzero(np.diff(up) > 1)
    first, last = up[np.r_[0, cuts + 1]], up[np.r_[cuts, up.size - 1]]
    tops = np.maximum.reduceat(amplitude, np.stack((first, last + 1), axis=1).ravel())[::2]
    whole = tops >= math.sqrt(_LEAST)
    first, last, tops = first[whole], last[whole], tops[whole]

    def crossing(inside: NDArray[np.intp], step: int) -> NDArray[np.float64]:
        beyond = amplitude[inside + step]
        share = (amplitude[inside] - 0.5 * tops) / np.maximum(amplitude[inside] - beyond, 1e-9)
        return np.asarray(inside + step * np.clip(share, 0.0, 1.0), np.float64)

    rise, fall = crossing(first, -1), crossing(last, 1)
    middles = 0.5 * (rise + fall) - 1.0 + 0.5 * cells.length / cells.hop
    return middles * cells.column_s, (fall - rise) * cells.column_s
