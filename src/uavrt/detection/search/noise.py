"""Estimate the noise power of each row from the statistic that is searched.

The original detector estimates noise in whole bins and interpolates to the half bins. A carrier
on a whole bin then raises the power in the half bins but not their threshold, which gives a
false alarm in each segment. Here the noise of each row is estimated separately.
"""

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.tuning import NOISE
from uavrt.dsp.sliding_medians import medians

_KEPT = 1.0 - math.exp(-NOISE.excluded_ratio)
"""Share of noise cells below `NOISE.excluded_ratio` times the mean noise power."""
_KAPPA = 1.0 - NOISE.excluded_ratio * math.exp(-NOISE.excluded_ratio) / _KEPT
"""Mean power of the noise cells below `NOISE.excluded_ratio`, as a share of the noise power:
0.925."""
_RISEN = math.exp(-NOISE.excluded_ratio / NOISE.rise_ratio)
"""Share of noise cells above `NOISE.excluded_ratio` after the noise has risen by
`NOISE.rise_ratio`."""


def _truncated(
    power: NDArray[np.float32], noise: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """One iteration of the noise power as a truncated mean; and the share of cells used."""
    kept = (power < np.float32(NOISE.excluded_ratio) * noise).astype(np.float32)
    columns = len(power)
    ones = np.ones(columns, np.float32)
    # Products with ones add columns several times faster than sums along an axis.
    count = ones @ kept
    np.multiply(kept, power, out=kept)
    mean = (ones @ kept) / (np.maximum(count, np.float32(1.0)) * np.float32(_KAPPA))
    return np.where(count > 0, mean, noise), count / np.float32(columns)


@lru_cache(maxsize=64)
def _neighbours(rows: int, reach: int, mode: Literal["wrap", "reflect"]) -> NDArray[np.intp]:
    padded = np.pad(np.arange(rows), reach, mode=mode)
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).copy()


def _noise_near_edge(
    noise: NDArray[np.float32], around: NDArray[np.intp], error: float
) -> NDArray[np.float32]:
    """Estimate the noise of rows where the spectrum is steep.

    At an edge the median of both sides is too low and gives 2 to 3.5 times the nominal false
    alarms. If one side is flat and includes the row, the median of that side is used; on a
    slope, that of the nearest rows. `around` (steep rows, 2 × reach + 1): numbers of the rows
    on both sides of each.
    """
    windows = noise[around]
    reach = windows.shape[1] // 2
    own = windows[:, reach]
    near = np.log(windows[:, max(0, reach - 2) : reach + 3]).mean(axis=1)
    # Five rows a quarter of a bin apart are worth one and a half independent rows.
    result = np.exp(near) * (1.0 + 0.5 * NOISE.usual_threshold * error**2 / 1.5)
    flattest = np.full(len(own), NOISE.edge_flat_ratio * error)
    for side in (windows[:, : reach + 1], windows[:, reach:]):
        level = np.median(side, axis=1)
        spread = side.std(axis=1) / level
        better = (spread < flattest) & (own > level * (1.0 - 2.5 * error))
        result[better], flattest[better] = level[better], spread[better]
    return np.asarray(result, np.float32)


class RowNoise:
    """Tracks the noise power of each row, from `independent_per_s` independent cells [1/s]."""

    def __init__(self, *, column_s: float, independent_per_s: float, circular: bool) -> None:
        self._column_s = column_s
        self._independent_per_s = independent_per_s
        self._circular = circular
        self._long: NDArray[np.float32] | None = None
        self._exceeding: NDArray[np.float32] | None = None
        self._seen_s = 0.0
        self._settled_s = 0.0
        self._level: NDArray[np.float32] = np.ones(1, np.float32)
        self.only_rises = False
        """True while frequency rows rise unequally: their noise estimates may only rise."""
        self.ragged = False
        """True while many carriers are removed; noise between them exceeds the median."""

    @property
    def ready(self) -> bool:
        """True once the noise has been estimated."""
        return self._long is not None

    @property
    def level(self) -> NDArray[np.float32]:
        """(rows,) noise power of each row; the search divides by it."""
        return self._level

    @property
    def relative_error(self) -> float:
        """Relative standard deviation of a row's level in white noise."""
        seconds = min(self._seen_s, 2.0 * NOISE.long_s)
        pooled = 1.0 if self._long is None else 2.0 * self._reach(len(self._long)) + 1.0
        # Rows a quarter of a bin apart and their median: worth one independent row in five.
        return 1.13 / math.sqrt(max(self._independent_per_s * seconds * pooled / 5.0, 1.0))

    def start(self, power: NDArray[np.float32]) -> None:
        """Make the first estimate from all present columns."""
        noise = medians(power) / np.float32(math.log(2.0))
        noise = np.maximum(noise, np.float32(1e-30))
        for _ in range(6):
            noise, kept = _truncated(power, noise)
            noise = np.maximum(noise, np.float32(1e-30))
        self._long = noise
        self._exceeding = np.maximum(1.0 - kept, np.float32(math.exp(-NOISE.excluded_ratio)))
        self._seen_s = len(power) * self._column_s
        self._settle()

    def take_over(self, other: "RowNoise", level: NDArray[np.float32]) -> None:
        """Continue from another band's noise estimate; `level`: its noise at these rows."""
        self._long, self._level = level, level.copy()
        self._exceeding = np.full_like(level, math.exp(-NOISE.excluded_ratio))
        self._seen_s, self._settled_s = other._seen_s, other._settled_s

    def update(self, power: NDArray[np.float32]) -> None:
        """Update the noise estimate with the power of new columns (columns, rows)."""
        if self._long is None or self._exceeding is None or not len(power):
            return
        mean, kept = _truncated(power, self._long)
        span_s = len(power) * self._column_s
        short_weight = 1.0 - math.exp(-span_s / NOISE.short_s)
        exceeding = self._exceeding
        exceeding += np.float32(short_weight) * ((1.0 - kept) - exceeding)
        self._seen_s += span_s
        weight = min(1.0, span_s * NOISE.step_gain / min(self._seen_s, NOISE.long_s))
        long = self._long + np.float32(weight) * (mean - self._long)
        if self.only_rises:
            np.maximum(long, self._long, out=long)
        self._long = long
        if exceeding.max() > _RISEN:
            rise = np.float32(-NOISE.excluded_ratio) / np.log(np.clip(exceeding, 1e-3, 0.98))
            rows = rise > NOISE.rise_ratio
            # Learn a rise at the short time constant; falls take the long one.
            long[rows] *= 1.0 + short_weight * (rise[rows] - 1.0)
            self._settle()
            self._level[rows] = np.maximum(
                self._level[rows], long[rows] * rise[rows] / (1.0 + short_weight)
            )
        elif self._seen_s - self._settled_s > NOISE.settle_s:
            self._settle()

    def _settle(self) -> None:
        """Replace each row's noise by the median of rows around it, unless they differ much."""
        assert self._long is not None
        self._settled_s = self._seen_s
        reach = self._reach(len(self._long))
        windows = self._long.take(_neighbours(len(self._long), reach, self._mode))
        windows.partition(reach, axis=1)
        smooth = windows[:, reach]
        if self._seen_s < NOISE.young_s and self._is_flat(smooth):
            # No more structure than by chance: all rows together give the better estimate.
            smooth = np.full_like(smooth, np.median(self._long))
        else:
            smooth = self._shaped(smooth, reach)
        # A row 2.5 standard deviations above its neighbours is a line, not a fluctuation.
        sigmas = NOISE.hum_sigmas if self.ragged else 2.5
        line = self._long > smooth * np.float32(1.0 + sigmas * self._row_error)
        self._level = np.where(line, self._long, smooth)

    def _is_flat(self, smooth: NDArray[np.float32]) -> bool:
        spread = float(smooth.std()) / max(float(smooth.mean()), 1e-30)
        return spread < NOISE.flat_ratio * self.relative_error

    @property
    def _mode(self) -> Literal["wrap", "reflect"]:
        """Padding mode beyond the ends of the band: rows of the other end, or mirrored rows."""
        return "wrap" if self._circular else "reflect"

    @property
    def _row_error(self) -> float:
        seconds = min(self._seen_s, 2.0 * NOISE.long_s)
        return 1.13 / math.sqrt(max(self._independent_per_s * seconds, 1.0))

    def _shaped(self, smooth: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
        """Estimate the noise of a sloped spectrum: each row by medians of nearby rows."""
        assert self._long is not None
        straight = self._straight(smooth, reach) if self._seen_s < NOISE.young_s else None
        if straight is not None:
            return straight
        around = _neighbours(len(self._long), reach, self._mode)
        before, after = smooth[around[:, 0]], smooth[around[:, -1]]
        least = max(NOISE.steep_errors * self.relative_error, NOISE.least_steep)
        steep = np.abs(before - after) > least * np.maximum(before, after)
        # Between two slopes both ends are alike, and the row far below them.
        steep |= self._long < smooth * np.float32(1.0 - 3.0 * self._row_error)
        if steep.any():
            smooth = smooth.copy()
            smooth[steep] = _noise_near_edge(self._long, around[steep], self._row_error)
        return smooth

    def _straight(self, smooth: NDArray[np.float32], reach: int) -> NDArray[np.float32] | None:
        """Fit a line in decibels to the noise of all rows; None if the rows do not fit it."""
        assert self._long is not None
        rows = np.arange(len(smooth), dtype=np.float64)
        # At the ends of a channel the medians include rows across the edge.
        inner = slice(reach, len(smooth) - reach) if self._circular else slice(None)
        if len(rows[inner]) < 2 * reach:
            return None
        slope, start = np.polyfit(rows[inner], np.log(smooth[inner]), 1)
        line = np.exp(start + slope * rows).astype(np.float32)
        if float((smooth[inner] / line[inner]).std()) > NOISE.flat_ratio * self.relative_error:
            return None
        line *= np.median(self._long / line)
        # Noise puts six rows in a thousand there; more rows mean a filter's edge.
        below = self._long < line * np.float32(1.0 - 2.5 * self._row_error)
        return line if float(below.mean()) < 0.03 else None

    def _reach(self, rows: int) -> int:
        reach = NOISE.young_reach if self._seen_s < NOISE.young_s else NOISE.reach
        return min(reach, rows // 2)
