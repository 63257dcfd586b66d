"""The original's statistic, for comparisons: written from its description, small and slow.

Half-overlapping rectangular windows one pulse long, a whole-bin and a
half-bin transform, noise of each whole bin with thresholds interpolated to the half bins, the
best pattern of K columns for each row, and a threshold from Monte Carlo and a Gumbel fit. One
segment at a time; tracking and confirmation are left out.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """What the original would report of a segment."""

    starts_s: tuple[float, ...]
    offset_hz: float
    score: float
    """In powers of a bin's noise."""


class OriginalDetector:
    """The original's search of single segments.

    `probability`: of a false group in a segment.
    `trials`: segments of noise for the threshold; the original took 100, which leaves the
    threshold 0.75 too low and too many false alarms (§4.5).
    """

    def __init__(
        self,
        tag: Tag,
        *,
        sample_rate_hz: float = 3750.0,
        probability: float = 0.01,
        trials: int = 400,
        seed: int = 1,
    ) -> None:
        self.rate = sample_rate_hz
        self.k = tag.k
        self.window = math.ceil(tag.pulse_width_s * sample_rate_hz - 1e-9)
        self.hop = self.window - self.window // 2

        def hops(seconds: float) -> int:
            return -(-math.ceil(seconds * sample_rate_hz - 1e-9) // self.hop)

        interval = math.ceil(tag.pulse_intervals_s[0] * sample_rate_hz - 1e-9) // self.hop
        self.error = hops(tag.interval_uncertainty_s)
        self.jitter = hops(tag.interval_jitter_s)
        self.intervals = range(interval - self.error, interval + self.error + 1)
        self.first = interval + self.error + 1 + (self.jitter if self.k == 1 else 0)
        self.columns = self.k * (interval + self.error) + self.jitter + 1
        self.segment = self.hop * self.columns + self.window // 2
        order = np.arange(self.window)
        whole = order - (self.window - 1) // 2
        # Ascending frequencies: whole bin, half bin, whole bin …, the Nyquist bin last.
        self.offsets_hz = (
            (np.repeat(whole, 2) + np.tile((0.0, 0.5), self.window))
            * sample_rate_hz
            / self.window
        )
        turn = np.outer(np.arange(self.window), -2j * np.pi * self.offsets_hz / sample_rate_hz)
        self._matrix = np.exp(turn) / math.sqrt(self.window)
        self.location, self.scale = self._gumbel(trials, seed)
        self.threshold = self.location - self.scale * math.log(-math.log(1.0 - probability))

    def powers(self, samples: NDArray[np.complex64]) -> NDArray[np.float64]:
        """|Y|^2 of each half bin and column: mean one in noise of unit power."""
        windows = np.lib.stride_tricks.sliding_window_view(samples, self.window)[:: self.hop]
        output = windows[: self.columns] @ self._matrix
        return np.asarray(np.abs(output.T) ** 2, np.float64)

    def noise(self, power: NDArray[np.float64]) -> NDArray[np.float64]:
        """Noise of each row: of the whole bins, interpolated to the half bins."""
        whole = power[::2]
        padded = np.pad(whole, ((0, 0), (1, 1)))
        count = np.full(whole.shape[1], 3.0)
        count[[0, -1]] = 2.0
        moving = (padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]) / count
        kept = whole <= 10.0 * np.median(moving, axis=1)[:, None]
        level = np.sum(whole * kept, axis=1) / np.maximum(kept.sum(axis=1), 1)
        at = np.arange(len(power)) / 2.0
        inside = np.interp(at, np.arange(len(level)), level)
        inside[-1] = 1.5 * level[-1] - 0.5 * level[-2]  # extrapolated at the end
        return np.asarray(np.maximum(inside, 1e-30), np.float64)

    def patterns(
        self, power: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Best sum of each row, and its first column and interval.

        Jitters are independent: the best over them is a sum of sliding maxima.
        """
        reach = self.jitter
        padded = np.pad(power, ((0, 0), (reach, reach)), constant_values=-np.inf)
        span = 2 * reach + 1
        best_near = np.lib.stride_tricks.sliding_window_view(padded, span, axis=1).max(axis=2)
        best = np.full(len(power), -np.inf)
        where = np.zeros((len(power), 2), np.int64)
        for interval in self.intervals if self.k > 1 else range(1, 2):
            total = power[:, : self.first].copy()
            for pulse in range(1, self.k):
                total += best_near[:, pulse * interval : pulse * interval + self.first]
            at = total.argmax(axis=1)
            value = total[np.arange(len(power)), at]
            better = value > best
            best[better] = value[better]
            where[better, 0], where[better, 1] = at[better], interval
        return best, where

    def detect(self, samples: NDArray[np.complex64]) -> Group | None:
        """The group that the original would report of a segment, or None."""
        power = self.powers(samples)
        score, where = self.patterns(power)
        noise = self.noise(power)
        over = score >= self.threshold * noise
        lower = np.concatenate(([-np.inf], score[:-1]))
        upper = np.concatenate((score[1:], [-np.inf]))
        peaks = np.flatnonzero(over & (score > lower) & (score > upper))
        if not len(peaks):
            return None
        members = {row: self._members(power[row], *where[row]) for row in peaks}
        # A pulse with more than 80 % of the sum speaks against a group, unless all are so.
        fair = [r for r in peaks if power[r, members[r]].max() <= 0.8 * score[r]]
        row = max(fair or list(peaks), key=lambda r: score[r])
        return Group(
            starts_s=tuple(c * self.hop / self.rate for c in members[row]),
            offset_hz=float(self.offsets_hz[row]),
            score=float(score[row] / noise[row]),
        )

    def _members(self, power: NDArray[np.float64], first: int, interval: int) -> list[int]:
        members = [int(first)]
        for pulse in range(1, self.k):
            middle = int(first + pulse * interval)
            low, high = middle - self.jitter, min(middle + self.jitter + 1, len(power))
            members.append(low + int(power[low:high].argmax()))
        return members

    def _gumbel(self, trials: int, seed: int) -> tuple[float, float]:
        """Maximum-likelihood fit of the largest sum of a segment of noise."""
        rng = np.random.default_rng(seed)
        largest = np.empty(trials)
        for trial in range(trials):
            parts = rng.standard_normal((self.segment, 2)) * math.sqrt(0.5)
            largest[trial] = self.patterns(self.powers(parts @ np.array([1.0, 1j])))[0].max()
        scale = float(largest.std()) * math.sqrt(6.0) / math.pi
        for _ in range(100):
            weights = np.exp(-(largest - largest.mean()) / scale)
            scale += 0.5 * (
                largest.mean() - float((largest * weights).sum() / weights.sum()) - scale
            )
        middle = float(largest.mean())
        mean = float(np.exp(-(largest - middle) / scale).mean())
        return middle - scale * math.log(mean), scale
