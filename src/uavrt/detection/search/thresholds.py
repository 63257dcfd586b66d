"""Compute thresholds by a formula with one calibrated factor, valid from the first sample on.

The expected number of false groups in a decision interval is the number of effective
hypotheses, multiplied by the probability that one of them passes. This probability is the tail
of a sum of one exponential variable (the anchor) and K - 1 maxima over the jitter; each term is
limited.
"""

import math
from functools import lru_cache

import numpy as np

from uavrt.core.messages import Tag
from uavrt.detection.search.tuning import GROUPS, THRESHOLDS


def decision_interval_s(tag: Tag, rate: int = 1) -> float:
    """Time between decisions of the original detector [s], to which false-alarm rates refer.

    With hops of half a pulse at 3750 S/s, a segment has K (N + M) + J + 1 columns, of which 2
    (K M + J) are used again. For the thesis's tag the interval is 3.567 s at K = 3.
    """
    k = tag.k
    window = math.ceil(tag.pulse_width_s * THRESHOLDS.original_rate_hz - 1e-9)
    hop = window - window // 2
    intervals = (
        math.ceil(tag.pulse_intervals_s[rate - 1] * THRESHOLDS.original_rate_hz - 1e-9) // hop
    )
    error = -(
        -math.ceil(tag.interval_uncertainty_s * THRESHOLDS.original_rate_hz - 1e-9) // hop
    )
    jitter = -(-math.ceil(tag.interval_jitter_s * THRESHOLDS.original_rate_hz - 1e-9) // hop)
    segment = hop * (k * (intervals + error) + jitter + 1) + window // 2
    again = hop * 2 * (k * error + jitter)
    return max((segment - again) / THRESHOLDS.original_rate_hz, tag.pulse_intervals_s[rate - 1])


def decision_span_s(tag: Tag, rate: int = 1) -> float:
    """Duration of the samples for one decision of the original detector: K pulses [s]."""
    overlap_s = 2.0 * (tag.k * tag.interval_uncertainty_s + tag.interval_jitter_s)
    return decision_interval_s(tag, rate) + overlap_s


def begun_within_s(tag: Tag, rate: int = 1) -> float:
    """Duration in which a group of the first decision can begin [s].

    The original detector's steps are whole columns. If the tag's uncertainties are small, this
    rounding shortens the duration by up to a millisecond per pulse. Without the minimum used
    here, no time would be left for K of 60 or more.
    """
    interval_s = tag.pulse_intervals_s[rate - 1]
    begun_s = decision_span_s(tag, rate) - (tag.k - 1) * interval_s
    return max(begun_s, THRESHOLDS.least_begun * interval_s)


def _tail(k: int, spread: float, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Sums x, and the probability that noise reaches each, for one hypothesis of K pulses.

    The sum has one exponential variable and k - 1 maxima of `spread` exponential variables
    each; every term is limited to `limit`.
    """
    top = limit if math.isfinite(limit) else 60.0
    x = np.arange(0.0, top + THRESHOLDS.tail_step, THRESHOLDS.tail_step)
    anchor = 1.0 - np.exp(-x)
    other = (1.0 - np.exp(-x)) ** spread
    anchor[-1] = other[-1] = 1.0
    total_length = k * (len(x) - 1) + 1
    size = 1 << (total_length - 1).bit_length()
    density_a = np.fft.rfft(np.diff(anchor, prepend=0.0), size)
    density_o = np.fft.rfft(np.diff(other, prepend=0.0), size)
    density = np.fft.irfft(density_a * density_o ** (k - 1), size)[:total_length]
    tail = np.maximum(np.cumsum(density[::-1])[::-1], 0.0)
    return np.arange(total_length) * THRESHOLDS.tail_step, tail


@lru_cache(maxsize=8)  # of 20 kB; a threshold is computed in fifty look-ups, then stored
def _log_tail(k: int, spread: float, limit: float) -> tuple[np.ndarray, np.ndarray]:
    x, tail = _tail(k, spread, limit)
    return x, np.log(np.maximum(tail, 1e-300))


def group_tail(
    k: int, spread: float, threshold: float, limit: float = GROUPS.cell_limit
) -> float:
    """Probability that the sum of one hypothesis in noise reaches the threshold.

    `limit`: maximum power that a cell adds to the sum [noise powers].
    """
    if k == 1:
        return math.exp(-threshold)
    x, log_tail = _log_tail(k, round(spread, 3), round(limit, 2))
    return float(np.exp(np.interp(threshold, x, log_tail)))


_FACTOR_K = np.log(THRESHOLDS.ks)
_FACTOR_LOG = np.log(THRESHOLDS.hypotheses)
"""Log of the calibrated number of hypotheses per independent cell and interval, for each K."""


def effective_hypotheses(
    *,
    k: int,
    bandwidth_hz: float,
    time_s: float,
    pulse_width_s: float,
    uncertainty_s: float,
    reach_s: float,
    finer: float = 1.0,
) -> float:
    """Effective number of independent hypotheses with an anchor in a band and a time span.

    `finer`: as returned by `finer_times`.
    """
    cells = max(1.0, (bandwidth_hz + 1.0 / pulse_width_s) * time_s * finer)
    width_s = pulse_width_s / 2.0 + reach_s
    intervals = 1.0 + (k - 1) * uncertainty_s / width_s if k > 1 else 1.0
    factor = math.exp(float(np.interp(math.log(k), _FACTOR_K, _FACTOR_LOG)))
    power = float(np.interp(math.log(k), _FACTOR_K, THRESHOLDS.interval_powers))
    return factor * cells * float(intervals**power)


def finer_times(tag: Tag, most: float = THRESHOLDS.most_finer) -> float:
    """Number of independent times in a pulse width, relative to a tag of constant frequency.

    A sliding pulse matches only windows at its own time, so noise in the windows before and
    after is more independent. `most`: limit, which for the grid follows from its columns.
    """
    bins = abs(tag.frequency_slide_hz) * tag.pulse_width_s
    return min(1.0 + THRESHOLDS.finer_per_bin * bins, most)


def spread(tag: Tag, *, reach_s: float) -> float:
    """Number of independent exponential variables whose maximum is like one over the jitter."""
    return 1.0 + 2.5 * 2.0 * reach_s / tag.pulse_width_s * finer_times(tag)


@lru_cache(maxsize=1024)
def threshold(*, k: int, hypotheses: float, spread: float, expected_false: float) -> float:
    """Threshold for the sum of the powers of K cells [noise powers]."""
    low, high = 0.1, 400.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        if hypotheses * group_tail(k, spread, middle) > expected_false:
            low = middle
        else:
            high = middle
    return high


def young_margin(threshold: float, noise_error: float) -> float:
    """Factor on a threshold while the noise estimate is less accurate than usual.

    The tail of noise falls as exp(-T), where T is the threshold. So a relative error s of the
    noise level multiplies the false alarms by exp((T s)^2 / 2), and the factor 1 + T s^2 / 2
    compensates for this. The tables of thresholds include the usual error.
    """
    more = max(0.0, noise_error**2 - THRESHOLDS.noise_error**2)
    return 1.0 + 0.5 * threshold * more


def weakest_enr_db(k: int, threshold: float) -> float:
    """ENR of K equal pulses whose sum reaches a threshold in nine of ten groups [dB]; a cell
    has mean 1 + E and variance 1 + 2 E, and the sum is taken as normal.
    """
    # With x = 1 + 2 E: K (x + 1) / 2 - z sqrt(K x) = threshold, a square equation in sqrt(x).
    half = THRESHOLDS.nine_of_ten / math.sqrt(k)
    root = half + math.sqrt(max(0.0, half**2 + 2.0 * threshold / k - 1.0))
    return 10.0 * math.log10(max(0.5 * (root**2 - 1.0), 1e-3))
