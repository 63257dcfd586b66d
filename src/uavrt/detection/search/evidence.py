"""Evidence for a candidate: its likelihood ratio summed over all that is not known of it.

The search takes the best cell at each place, for speed; a sum of the best is not the best sum.
In noise of known power a cell of power P is exp(-E) I0(2 sqrt(E P)) times as likely with a
pulse of ENR E as without. The product over K places, averaged over where each pulse may lie and
summed over the lattices and frequencies around a candidate, is what a Bayesian compares with
its price; in noise its mean is the number of lattices summed, so the chance to exceed a bound
falls as one over the bound.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import Grid
from uavrt.detection.search.hypotheses import Candidate, RateSearch
from uavrt.detection.search.refine import Refiner
from uavrt.detection.search.thresholds import begun_within_s, decision_interval_s
from uavrt.messages import Tag

POWER_LIMIT = 16.0
"""Most that one pulse counts for, in noise powers: else one impulse carries a group."""
_TABLE_STEP = 0.02
_STEPS_PER_PULSE = 25
"""Steps of a pulse's start: a cell's power falls by a twelfth from one to the next."""
_ROWS_BINS = 0.125
"""Step of the frequencies, and from the candidate's row to both ends twice that, in bins."""
_FREQUENCIES = 5
_JITTER_SHARE = 0.4
"""Standard deviation of a pulse's jitter as a share of its bound."""


_GATE = 0.9
"""Least score of a candidate that is weighed, as a share of the search's threshold."""
_SURE_SCORE = 1.2
"""From here on nothing needs to be weighed: two cells at their limit, a third above noise."""
_FIRST_SHARE = 0.8
_FACTOR_LOG = {3: -3.7}
"""Logarithm of the groups of noise at a bound of one for each lattice, by K: calibrated."""
_SLOPE = 1.2
"""The limit makes the tail longer than one over the bound: calibrated."""


def gate(k: int) -> float:
    """Share of the search's threshold that makes a candidate of K pulses."""
    return _GATE if k in _FACTOR_LOG else 1.0


class Evidence:
    """Weighs the candidates of one detector."""

    def __init__(self, tag: Tag, *, grid: Grid, refiner: Refiner) -> None:
        self._tag = tag
        self._grid = grid
        self._refiner = refiner
        self._half_band_hz = 2.0 * _ROWS_BINS * grid.sample_rate_hz / grid.window
        self._step = max(1, round(grid.window / _STEPS_PER_PULSE))
        sigma = _JITTER_SHARE * tag.interval_jitter_s * grid.sample_rate_hz / self._step
        reach = tag.interval_jitter_s * grid.sample_rate_hz + 2 * grid.hop
        self._side = max(2, math.ceil(reach / self._step))
        self._spread = _kernel(self._side, round(sigma, 3))
        self._lattices = _lattices(tag.k, self._side)
        # Of a lattice's middle, of its ends against that, and of the frequency.
        self._cell = math.log((self._step / grid.window) ** 2 * _ROWS_BINS)
        rates = len(tag.pulse_intervals_s)
        self._bounds = [self._bounds_of(rate) for rate in range(1, rates + 1)]

    def suffices(
        self, candidate: Candidate, search: RateSearch, noise: NDArray[np.float32]
    ) -> bool:
        """Whether a candidate is likelier than what noise makes as often as is allowed."""
        share = gate(search.k)
        if share == 1.0 or candidate.score >= _SURE_SCORE:
            return True
        steady, first = self._bounds[candidate.rate - 1]
        bound = steady if search.steady else first
        # What the margin of a young noise adds to the threshold, in the tail's exponent.
        bound += search.threshold * max(0.0, search.margin / share - 1.0)
        starts = np.array([self._grid.start(column) for column in candidate.columns])
        offset = float(self._grid.offsets_hz[candidate.row])
        strength = search.threshold / search.k
        level = np.array([self._refiner.noise_at(offset, noise, at) for at in starts.tolist()])
        return self.weigh(starts, offset, level, strength) >= bound

    def _bounds_of(self, rate: int) -> tuple[float, float]:
        """Least evidence for a group: usually, and in the first decision interval."""
        tag, grid = self._tag, self._grid
        width_s = tag.pulse_width_s
        usual_s = decision_interval_s(tag, rate)
        begun_s = begun_within_s(tag, rate)
        band_hz = float(grid.offsets_hz[-1] - grid.offsets_hz[0]) + 1.0 / width_s
        lattices = (
            band_hz * usual_s * (1.0 + (tag.k - 1) * tag.interval_uncertainty_s / width_s)
        )
        factor = _FACTOR_LOG.get(tag.k, 0.0)
        allowed = tag.false_alarm_probability / len(tag.pulse_intervals_s)
        bound = math.log(lattices) + factor - _SLOPE * math.log(allowed)
        return bound, bound + math.log(_FIRST_SHARE * min(1.0, begun_s / usual_s))

    def weigh(
        self,
        starts: NDArray[np.float64],
        offset_hz: float,
        level: float | NDArray[np.float64],
        strength: float,
    ) -> float:
        """Logarithm of the likelihood ratio around a candidate.

        `starts` (K,): index of the first sample of each pulse. What the samples do not hold
        speaks neither for a pulse nor against it.
        `level` (K,): noise power of a sample, at all pulses or each.
        `strength`: ENR (not in dB) of a pulse, were there one.
        Returns: of a density over the lattice's middle and its ends, in pulse widths, and over
        frequency, in bins.
        """
        side, step = self._side, self._step
        window, table = self._grid.window, _ratios(round(strength, 2))
        points = 2 * side + 1
        first = np.rint(starts).astype(np.int64) - side * step
        power, offset = self._refiner.powers(
            first, (points - 1) * step + 1, offset_hz, self._half_band_hz, _FREQUENCIES
        )
        ratios = np.ones((len(starts), _FREQUENCIES, points), np.float64)
        if power is not None:
            scale = 1.0 / (window * _TABLE_STEP * np.asarray(level).reshape(-1, 1, 1))
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
    """Likelihood ratio of a pulse to none, by power in steps of `_TABLE_STEP`."""
    power = np.arange(0.0, POWER_LIMIT + _TABLE_STEP, _TABLE_STEP)
    return np.asarray(np.exp(-strength) * np.i0(2.0 * np.sqrt(strength * power)))


@lru_cache(maxsize=8)
def _kernel(side: int, sigma: float) -> NDArray[np.float64]:
    """Averages over a pulse's jitter, shape (points, points); zero outside of these."""
    away = np.arange(2 * side + 1)
    apart = away[:, np.newaxis] - away[np.newaxis, :]
    if sigma <= 0.2:
        return np.eye(len(away))
    weight = np.exp(-0.5 * (apart / sigma) ** 2)
    return np.asarray(weight / np.exp(-0.5 * (np.arange(-99, 100) / sigma) ** 2).sum())


@lru_cache(maxsize=8)
def _lattices(k: int, side: int) -> NDArray[np.intp]:
    """Point of each place for each lattice around the candidate, shape (K, lattices).

    By the shift of the middle and of the ends against it, both in steps.
    """
    middle, turn = np.meshgrid(np.arange(-side, side + 1), np.arange(-side, side + 1))
    inside = np.abs(middle) + np.abs(turn) <= side
    middle, turn = middle[inside], turn[inside]
    ends = np.linspace(-1.0, 1.0, k)
    points = side + middle + np.rint(ends[:, np.newaxis] * turn)
    return np.asarray(points.astype(np.intp))
