"""Find coded tags in a recording: bursts that repeat with the same gaps.

Single pulses are strong enough, since the tag is near while it is measured. Pulses within a
quarter of a second form a burst. Bursts with the same number of pulses and the same gaps are
one tag, and their times give the burst interval.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.config.code_rules import GAP_TOLERANCE_S
from uavrt.detection.beeps.interval_fit import Beat, fit_beat
from uavrt.detection.beeps.trains import BURST_S, FEWEST_BURSTS, split_bursts
from uavrt.detection.coded.cells import Cells
from uavrt.dsp.block_times import BlockTimes
from uavrt.messages import ChannelBlock, Tag

LONGEST_PULSE_S: Final = 0.006
"""Longest pulse of a coded tag [s]: they have 2.5 ms; beeping tags have 8 ms and more."""
_WIDTH_S: Final = 0.0025
_LEAST: Final = 30.0
"""Least energy of a pulse over that of noise: 15 dB."""
_PEAKED: Final = 4.0
"""Least ratio of a pulse's energy at its frequency to the median within 1 kHz."""
_OFF_BEAT_S: Final = 0.008
"""Largest deviation of a burst from whole burst intervals [s]."""
_MOST_LOST: Final = 4
"""Most intervals in the shortest time between two heard bursts."""
_WINDOW_HZ: Final = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredCode:
    """A coded tag as measured; each sigma is one standard deviation."""

    frequency_hz: float
    gaps_s: tuple[float, ...]
    gaps_sigma_s: tuple[float, ...]
    burst_interval_s: float
    burst_interval_sigma_s: float
    bursts: int

    def entry(self, tag_id: int, name: str | None = None) -> Tag:
        """Tag list entry with the usual tolerances."""
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


def find_codes(times_s: NDArray[np.float64], frequency_hz: float) -> list[MeasuredCode]:
    """Find the codes among the times of pulses at one frequency, ascending."""
    left = split_bursts(times_s)
    found = []
    while left:
        first = np.diff(left[0])
        same = [one for one in left if len(one) == len(left[0])]
        same = [one for one in same if np.abs(np.diff(one) - first).sum() <= GAP_TOLERANCE_S]
        alike = {id(one) for one in same}
        left = [one for one in left if id(one) not in alike]
        if len(same) >= FEWEST_BURSTS and (code := _code(same, frequency_hz)) is not None:
            found.append(code)
    return found


def _code(bursts: list[NDArray[np.float64]], frequency_hz: float) -> MeasuredCode | None:
    """Measure bursts of the same gaps; None where they are not periodic."""
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
    """Fit the longest interval of which the times between bursts are whole multiples.

    Where every second burst is lost, the shortest time between two is more than one interval.
    """
    shortest_s = float(np.diff(starts_s).min())
    for part in range(1, _MOST_LOST + 1):
        if shortest_s / part < BURST_S:
            break
        beat = fit_beat(starts_s, shortest_s / part)
        off_s = np.abs(beat.residuals_s)
        kept = off_s <= max(3.0 * float(np.median(off_s)), _OFF_BEAT_S)
        if kept.sum() >= max(FEWEST_BURSTS, 0.75 * len(starts_s)):
            beat = fit_beat(starts_s[kept], beat.interval_s)
            if beat.scatter_s <= _OFF_BEAT_S:
                return beat
    return None


class BurstPulses:
    """Finds the starts of a coded tag's pulses in the samples of a channel.

    `frequency_hz`: frequency of the short pulses already seen.
    """

    def __init__(self, frequency_hz: float, rate_hz: float) -> None:
        self._frequency_hz = frequency_hz
        self._rate_hz = rate_hz
        self._times = BlockTimes(rate_hz)
        self._cells: Cells | None = None
        self._held = np.zeros(0, np.complex64)
        self._taken = 0
        self._rows = [np.zeros(0, np.float32)]

    def process(self, block: ChannelBlock) -> None:
        """Add the channel's next block."""
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

    def finish(self) -> NDArray[np.float64]:
        """Return the starts of the strong pulses, ascending [s from the first sample]."""
        if self._cells is None:
            return np.zeros(0)
        self._push(self._cells)
        starts = self._rate_hz * _starts(np.concatenate(self._rows), self._cells)
        return np.sort(self._times.seconds(starts, self._times.start_ns))


def _starts(energies: NDArray[np.float32], cells: Cells) -> NDArray[np.float64]:
    energy = energies.astype(np.float64)
    reach = cells.pulse
    tall = np.lib.stride_tricks.sliding_window_view(np.pad(energy, reach), 2 * reach + 1)
    top = np.flatnonzero((energy >= _LEAST) & (energy == tall.max(axis=1)))
    top = top[(top >= reach) & (top < len(energy) - reach)]
    # The filter falls off linearly to both sides: amplitudes give the place between columns.
    near = max(1, reach // 3)
    left, right = np.sqrt(energy[top - near]), np.sqrt(energy[top + near])
    shift = 0.5 * reach * (right - left) / np.sqrt(energy[top])
    return np.asarray((top + np.clip(shift, -1.0, 1.0)) * cells.column_s, np.float64)
