"""Compute the likelihood ratio of a candidate group, summed over its unknown parameters.

For speed, the search takes the best cell for each pulse, which does not give the best sum. In
noise of known power, a cell of power P is exp(-E) I0(2 sqrt(E P)) times as likely with a pulse
of ENR E as without. The product over K pulses is averaged over each pulse's time. It is summed
over the lattices (series of evenly spaced pulse times) and frequencies around a candidate. The
result is a Bayes factor. In noise its mean is the number of lattices, so the probability that
it exceeds a bound is inversely proportional to the bound.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.search.grid import Grid
from uavrt.detection.search.hypotheses import Candidate, RateSearch
from uavrt.detection.search.refine import Refiner
from uavrt.detection.search.thresholds import begun_within_s, decision_interval_s, finer_times
from uavrt.detection.search.tuning import EVIDENCE, THRESHOLDS


def gate(tag: Tag) -> float:
    """Minimum score of a tag's candidates, as a share of the search's threshold.

    It is below 1 for tags with `EVIDENCE.tested_k` pulses and a jitter of few pulse widths,
    because their candidates are also tested by their likelihood. With more jitter, the number
    of lattices to sum, and their memory, would have no limit.
    """
    most_jitter_s = EVIDENCE.most_jitter_widths * tag.pulse_width_s
    tested = tag.k == EVIDENCE.tested_k and tag.interval_jitter_s <= most_jitter_s
    return EVIDENCE.gate if tested else 1.0


class Evidence:
    """Tests candidates near the threshold by their likelihood, for tags with `gate` below 1."""

    def __init__(self, tag: Tag, *, grid: Grid, refiner: Refiner) -> None:
        self._tag = tag
        self._grid = grid
        self._refiner = refiner
        self._half_band_hz = 2.0 * EVIDENCE.row_bins * grid.sample_rate_hz / grid.window
        self._step = max(1, round(grid.window / EVIDENCE.steps_per_pulse))
        sigma = EVIDENCE.jitter_share * tag.interval_jitter_s * grid.sample_rate_hz / self._step
        reach = tag.interval_jitter_s * grid.sample_rate_hz + 2 * grid.hop
        self._side = max(2, math.ceil(reach / self._step))
        self._spread = _kernel(self._side, round(sigma, 3))
        self._lattices = _lattices(tag.k, self._side)
        # Steps of a lattice's middle, of its ends relative to that, and of the frequency.
        # A common shift of sliding pulses acts as a shift of frequency, so only the times of
        # the two ends relative to each other are finer.
        finer = finer_times(tag, math.inf)
        self._cell = math.log((self._step / grid.window) ** 2 * finer * EVIDENCE.row_bins)
        rates = len(tag.pulse_intervals_s)
        self._bounds = [self._bounds_of(rate) for rate in range(1, rates + 1)]

    def suffices(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> bool:
        """True if noise makes such candidates less often than the false-alarm rate allows."""
        if candidate.score >= EVIDENCE.sure_score:
            return True
        steady, first = self._bounds[candidate.rate - 1]
        bound = steady if search.steady else first
        # Increase of the threshold by the margin for uncertain noise, in the tail's exponent.
        bound += search.threshold * max(0.0, search.margin / EVIDENCE.gate - 1.0)
        starts = np.array([self._grid.start(column) for column in candidate.columns])
        offset = float(self._grid.offsets_hz[candidate.row])
        strength = search.threshold / search.k
        level = np.array([self._refiner.noise_at(offset, noise, at) for at in starts.tolist()])
        return self.weigh(starts, offset, level, strength) >= bound

    def _bounds_of(self, rate: int) -> tuple[float, float]:
        """Minimum log-likelihood ratios of a group: for later decisions, and for the first."""
        tag, grid = self._tag, self._grid
        width_s = tag.pulse_width_s
        usual_s = decision_interval_s(tag, rate)
        begun_s = begun_within_s(tag, rate)
        band_hz = float(grid.offsets_hz[-1] - grid.offsets_hz[0]) + 1.0 / width_s
        lattices = (
            band_hz * usual_s * (1.0 + (tag.k - 1) * tag.interval_uncertainty_s / width_s)
        )
        rates = len(tag.pulse_intervals_s)
        allowed_log = math.log(tag.false_alarm_probability) - math.log(rates)
        bound = math.log(lattices) + EVIDENCE.factor_log - EVIDENCE.slope * allowed_log
        return bound, bound + math.log(THRESHOLDS.first_share * min(1.0, begun_s / usual_s))

    def weigh(
        self,
        starts: NDArray[np.float64],
        offset_hz: float,
        level: float | NDArray[np.float64],
        strength: float,
    ) -> float:
        """Log-likelihood ratio of a candidate's pulses to noise, summed over nearby parameters.

        `starts` (K,): first samples of the pulses; a missing pulse does not change the result.
        `level` (K,): noise power of a sample. `strength`: assumed ENR of a pulse.
        """
        side, step = self._side, self._step
        window, table = self._grid.window, _ratios(round(strength, 2))
        points = 2 * side + 1
        first = np.rint(starts).astype(np.int64) - side * step
        power, offset = self._refiner.powers(
            first, (points - 1) * step + 1, offset_hz, self._half_band_hz, EVIDENCE.frequencies
        )
        ratios = np.ones((len(starts), EVIDENCE.frequencies, points), np.float64)
        if power is not None:
            scale = 1.0 / (window * EVIDENCE.table_step * np.asarray(level).reshape(-1, 1, 1))
            cells = np.minimum(power * scale, len(table) - 1).astype(np.intp)
            at = np.arange(points) * step
            for place, shift in enumerate(offset.tolist()):
                inside = np.flatnonzero((at >= shift) & (at - shift < power.shape[2]))
                ratios[place][:, inside] = table[cells[place][:, at[inside] - shift]]
        likely = ratios @ self._spread
        product = likely[0][:, self._lattices[0]]
        for place in range(1, len(starts)):
            product = product * likely[place][:, self._lattices[place]]
        return math.log(max(float(product.sum()), 1e-300)) + self._cell


@lru_cache(maxsize=8)
def _ratios(strength: float) -> NDArray[np.float64]:
    """Table of likelihood ratios of pulse to noise, by power [`EVIDENCE.table_step`]."""
    power = np.arange(0.0, EVIDENCE.power_limit + EVIDENCE.table_step, EVIDENCE.table_step)
    return np.asarray(np.exp(-strength) * np.i0(2.0 * np.sqrt(strength * power)))


@lru_cache(maxsize=8)
def _kernel(side: int, sigma: float) -> NDArray[np.float64]:
    away = np.arange(2 * side + 1)
    apart = away[:, np.newaxis] - away[np.newaxis, :]
    if sigma <= 0.2:
        return np.eye(len(away))
    weight = np.exp(-0.5 * (apart / sigma) ** 2)
    return np.asarray(weight / np.exp(-0.5 * (np.arange(-99, 100) / sigma) ** 2).sum())


@lru_cache(maxsize=8)
def _lattices(k: int, side: int) -> NDArray[np.intp]:
    """Start of each pulse in each lattice tried around the candidate [steps], (K, lattices).

    Each lattice is shifted as a whole, and its two ends are shifted against each other.
    """
    middle, turn = np.meshgrid(np.arange(-side, side + 1), np.arange(-side, side + 1))
    inside = np.abs(middle) + np.abs(turn) <= side
    middle, turn = middle[inside], turn[inside]
    ends = np.linspace(-1.0, 1.0, k)
    points = side + middle + np.rint(ends[:, np.newaxis] * turn)
    return np.asarray(points.astype(np.intp))
