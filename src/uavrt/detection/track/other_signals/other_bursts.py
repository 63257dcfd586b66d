"""Measure the rate of other transmitters' bursts: recent strong cells that no track explains.

The rate gives the probability that a burst of a frequency hopper, time slot or voice occurs
where a tag's pulse is expected; in noise alone it is zero.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import ROWS_PER_BIN, Grid
from uavrt.detection.search.refine import Measured
from uavrt.detection.search.thresholds import effective_hypotheses
from uavrt.detection.search.tuning import GROUPS, THRESHOLDS
from uavrt.detection.track.chance import QUIET, BurstRates
from uavrt.detection.track.tracks import Track
from uavrt.detection.track.tuning import BURSTS

Known = tuple[float, float, float]
"""Known pulse: index of its first sample, offset from the channel's centre [Hz], power."""
_Cells = tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]


class Bursts:
    """Recent bursts of other transmitters in one band."""

    def __init__(self, grid: Grid, pulse_width_s: float) -> None:
        self._grid = grid
        self._width_s = pulse_width_s
        self._column_s = grid.hop / grid.sample_rate_hz
        self._noise_per_s = effective_hypotheses(
            k=1,
            bandwidth_hz=float(grid.offsets_hz[-1] - grid.offsets_hz[0]),
            time_s=1.0,
            pulse_width_s=pulse_width_s,
            uncertainty_s=0.0,
            reach_s=0.0,
        )
        """Rate of noise peaks above P noise powers, divided by exp(-P) [1/s]."""
        self._pending: tuple[list[int], list[int], list[float]] = ([], [], [])
        self._time_s = np.zeros(0)
        self._row = np.zeros(0, np.intp)
        self._power = np.zeros(0)
        self._begin_s = 0.0
        """Start of the time for which all bursts are stored [s]."""
        self._now_s = 0.0
        self._kept: _Cells = self._time_s, self._row, self._power

    def add(self, columns: list[int], rows: list[int], powers: list[float]) -> None:
        """Add strong cells that the search has finished testing, in order of time."""
        for own, new in zip(self._pending, (columns, rows, powers), strict=True):
            own += new  # type: ignore[operator]
        if len(self._pending[0]) > 2 * BURSTS.most_pending:
            self._begin_s = max(
                self._begin_s, self._pending[0][-BURSTS.most_pending] * self._column_s
            )
            for own in self._pending:
                del own[: -BURSTS.most_pending]

    def update(
        self,
        fresh: tuple[Sequence[int], Sequence[int], Sequence[float]],
        noise: NDArray[np.float32],
        *,
        now_column: int,
        begin_column: int,
        known: Sequence[Known],
    ) -> None:
        """Add the newest cells, which the search is still testing, and update the bursts."""
        self._now_s = now_column * self._column_s
        begin_s = begin_column * self._column_s
        oldest_s = max(self._begin_s, begin_s, self._now_s - BURSTS.memory_s)
        if self._pending[0]:
            new = self._gather(self._pending, noise)
            for own in self._pending:
                own.clear()
            self._time_s, self._row, self._power = (
                np.concatenate(pair)
                for pair in zip((self._time_s, self._row, self._power), new, strict=True)
            )
        if len(self._time_s):
            if len(self._time_s) > BURSTS.most_kept:
                oldest_s = max(oldest_s, float(self._time_s[-BURSTS.most_kept]))
            first = int(np.searchsorted(self._time_s, oldest_s))
            if first:
                self._time_s = self._time_s[first:]
                self._row, self._power = self._row[first:], self._power[first:]
        self._begin_s = oldest_s
        # Also earlier ones: a tag is confirmed some pulses after its first.
        held = self._without(known, (self._time_s, self._row, self._power))
        self._time_s, self._row, self._power = held
        if fresh[0]:
            new = self._without(known, self._gather(fresh, noise))
            time_s, row, power = (np.concatenate(pair) for pair in zip(held, new, strict=True))
            held = time_s, row, power
        self._kept = held

    def around(self, track: Track, found: Measured) -> BurstRates:
        """Rates of other transmitters' bursts around an expected pulse of a track.

        The track's own pulses are excluded.
        """
        time_s, row, power = self._kept
        if not len(time_s):
            return QUIET
        like = 10.0 ** (BURSTS.similar_db / 10.0)
        some = power * like >= found.power
        some &= ~self._on_lattice(track, found, time_s)
        if not some.any():
            return QUIET
        time_s, row, power = time_s[some], row[some], power[some]
        alike = power <= like * found.power
        offsets = self._grid.offsets_hz
        step_hz = float(offsets[1] - offsets[0]) if len(offsets) > 1 else 1.0
        own_row = (found.offset_hz - float(offsets[0])) / step_hz
        turn = self._grid.sample_rate_hz / step_hz
        away = (row - own_row + turn / 2.0) % turn - turn / 2.0
        own = np.abs(away) <= BURSTS.near_rows
        bands = max(1.0, len(offsets) / ROWS_PER_BIN)
        least = max(THRESHOLDS.least_power, found.power / like)
        noise_per_s = self._noise_per_s * math.exp(-least)
        begin, chance = 0.0, 0.0
        for window_s in BURSTS.windows_s:
            since_s = max(self._begin_s, self._now_s - window_s)
            received_s = max(self._now_s - since_s, 1.0)
            late = time_s >= since_s
            all_like = late & alike
            count = np.count_nonzero(all_like)
            pooled = count / received_s / bands
            here = self._distinct(time_s[all_like & own])
            begin = max(begin, beyond_noise(int(count), noise_per_s * received_s) / received_s)
            chance = max(
                chance, (here + BURSTS.pooled_s * pooled) / (received_s + BURSTS.pooled_s)
            )
            if received_s < window_s:
                break
        mine = time_s[own & alike]
        paired = self._paired(mine, track.interval_s, chance)
        received_s = max(self._now_s - self._begin_s, 1.0)
        return BurstRates(
            alike_per_s=max(chance, paired),
            hiding_per_s=self._distinct(time_s[own & (2.0 * power >= found.power)])
            / received_s,
            begin_per_s=begin,
        )

    def _on_lattice(
        self, track: Track, found: Measured, time_s: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """True for bursts at times at which pulses of the track were or would be expected."""
        rate_hz = self._grid.sample_rate_hz
        lag_s = self._grid.start(0) / rate_hz
        near_s = self._width_s
        own = np.zeros(len(time_s), np.bool_)
        for pulse in (found, *(slot.measured for slot in track.slots)):
            own |= np.abs(time_s + lag_s - pulse.start / rate_hz) < near_s
        places = (found.start / rate_hz - lag_s - time_s) / track.interval_s
        number = np.rint(places)
        reach_s = near_s + track.tag.interval_jitter_s
        reach_s = reach_s + 2.0 * np.abs(number) * max(track.variance[2], 0.0) ** 0.5
        own |= (np.abs(places - number) * track.interval_s < reach_s) & (
            reach_s < 0.1 * track.interval_s
        )
        return own

    def _distinct(self, time_s: NDArray[np.float64]) -> int:
        return len(set((time_s / self._width_s).astype(np.intp).tolist()))

    def _paired(
        self, time_s: NDArray[np.float64], interval_s: float, chance_per_s: float
    ) -> float:
        """Rate of bursts one interval after another burst [1/s], as in periodic frames."""
        if len(time_s) < 4:
            return 0.0
        time_s = np.sort(time_s)
        time_s = time_s[np.diff(time_s, prepend=-np.inf) > 0.5 * self._width_s]
        low = np.searchsorted(time_s, time_s + interval_s - BURSTS.pair_s)
        high = np.searchsorted(time_s, time_s + interval_s + BURSTS.pair_s)
        first = time_s[high > low]
        begun = np.count_nonzero(time_s < self._now_s - interval_s)
        phases = set((first % interval_s / (2.0 * self._width_s)).astype(np.intp).tolist())
        if begun < 4 or len(phases) < BURSTS.least_phases:
            return 0.0
        expected = chance_per_s * 2.0 * BURSTS.pair_s * begun
        if len(first) < expected + 2.0 * expected**0.5:
            return 0.0
        return len(first) / begun / (2.0 * BURSTS.pair_s)

    def _without(self, known: Sequence[Known], cells: _Cells) -> _Cells:
        """Remove the cells that known pulses or their leakage explain."""
        time_s, row, power = cells
        if not known or not len(time_s):
            return cells
        grid = self._grid
        start, offset_hz, strength = np.array(known).T
        at_s = (start - grid.start(0)) / grid.sample_rate_hz
        first = time_s.searchsorted(at_s - self._width_s)
        last = time_s.searchsorted(at_s + self._width_s, "right")
        new = np.ones(len(time_s), np.bool_)
        for place in np.flatnonzero(last > first).tolist():
            some = slice(first[place], last[place])
            away_hz = grid.offsets_hz[row[some]] - offset_hz[place]
            away_hz -= grid.sample_rate_hz * np.rint(away_hz / grid.sample_rate_hz)
            apart = np.abs(away_hz) * grid.window / grid.sample_rate_hz
            leak = strength[place] / np.maximum(1.0, math.pi * apart / 2.0) ** 2
            new[some] &= (apart > GROUPS.same_bins) & (leak < GROUPS.leak_share * power[some])
        return cells if new.all() else (time_s[new], row[new], power[new])

    def _gather(
        self,
        cells: tuple[Sequence[int], Sequence[int], Sequence[float]],
        noise: NDArray[np.float32],
    ) -> _Cells:
        """Time, row and power of the strongest cell of each burst in each frequency bin."""
        time_s = np.array(cells[0]) * self._column_s
        row = np.array(cells[1])
        power = np.array(cells[2]) / noise[row]
        strong = power >= THRESHOLDS.least_power
        time_s, row, power = time_s[strong], row[strong], power[strong]
        strongest = (-power).argsort(kind="stable")
        place = (time_s / self._width_s).astype(np.intp) * 4096 + row // ROWS_PER_BIN
        _, first = np.unique(place[strongest], return_index=True)
        kept = strongest[first]
        kept = kept[time_s[kept].argsort(kind="stable")]
        return time_s[kept], row[kept], power[kept]


def beyond_noise(count: int, expected: float) -> float:
    """Number of bursts beyond those expected from noise; 0 if the excess may be chance."""
    more = count - expected
    return more if more > BURSTS.noise_sigmas * expected**0.5 else 0.0
