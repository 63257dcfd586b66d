"""Thresholds from a formula with a calibrated factor: available at the first sample.

The expected number of false groups in a decision interval is the number of effective hypotheses
times the chance that one of them passes; the chance is the tail of a sum of one exponential
(the anchor) and K - 1 maxima over the jitter, each limited.

The search begins as soon as a threshold can be reached (1 s at K = 3). Until 2.5 s, the noise
is measured again with each batch, and the threshold raised by 1 + T (s² - s0²) / 2 for its
error s, s0 being the error after 2.5 s. Waiting for 2.5 s would report a tag that is already
sending up to 1.35 s after its last pulse, where 0.5 s are allowed.
"""

import math
from functools import lru_cache

import numpy as np

from uavrt.detection.search.hypotheses import CELL_LIMIT
from uavrt.messages import Tag

LEAST_POWER = 13.0
"""Least power of a burst; noise reaches it each six seconds in a channel of 3.75 kHz."""
_STEP = 0.01
_ORIGINAL_RATE_HZ = 3750.0
_NINE_OF_TEN = 1.2816
"""Quantile of the normal distribution."""
_LEAST_BEGUN = 0.25
"""Least share of an interval in which a group can begin; larger up to K = 40."""
USUAL_NOISE_ERROR = 0.033
"""Relative error of the noise after 2.5 s, with which the factors below were calibrated."""


def decision_interval_s(tag: Tag, rate: int = 1) -> float:
    """Time between decisions of the original, the reference for false-alarm rates.

    Reference/detector.md §0 and §3: with hops of half a pulse at 3750 S/s a segment is K (N +
    M) + J + 1 columns of which 2 (K M + J) are seen again; 3.567 s for the thesis's tag at K =
    3.
    """
    k = tag.k
    window = math.ceil(tag.pulse_width_s * _ORIGINAL_RATE_HZ - 1e-9)
    hop = window - window // 2
    intervals = math.ceil(tag.pulse_intervals_s[rate - 1] * _ORIGINAL_RATE_HZ - 1e-9) // hop
    error = -(-math.ceil(tag.interval_uncertainty_s * _ORIGINAL_RATE_HZ - 1e-9) // hop)
    jitter = -(-math.ceil(tag.interval_jitter_s * _ORIGINAL_RATE_HZ - 1e-9) // hop)
    segment = hop * (k * (intervals + error) + jitter + 1) + window // 2
    again = hop * 2 * (k * error + jitter)
    return max((segment - again) / _ORIGINAL_RATE_HZ, tag.pulse_intervals_s[rate - 1])


def decision_span_s(tag: Tag, rate: int = 1) -> float:
    """Length of the stretch for one decision of the original, which surely holds K pulses."""
    overlap_s = 2.0 * (tag.k * tag.interval_uncertainty_s + tag.interval_jitter_s)
    return decision_interval_s(tag, rate) + overlap_s


def begun_within_s(tag: Tag, rate: int = 1) -> float:
    """Length of the stretch in which a group of the first decision can begin.

    The original's steps are whole columns, which for tags with small uncertainties round away
    up to a millisecond per pulse; from K = 60 on nothing would be left.
    """
    interval_s = tag.pulse_intervals_s[rate - 1]
    begun_s = decision_span_s(tag, rate) - (tag.k - 1) * interval_s
    return max(begun_s, _LEAST_BEGUN * interval_s)


def _tail(k: int, spread: float, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Tail of a sum of one exponential and k - 1 maxima of `spread` exponentials."""
    top = limit if math.isfinite(limit) else 60.0
    x = np.arange(0.0, top + _STEP, _STEP)
    anchor = 1.0 - np.exp(-x)
    other = (1.0 - np.exp(-x)) ** spread
    anchor[-1] = other[-1] = 1.0
    total_length = k * (len(x) - 1) + 1
    size = 1 << (total_length - 1).bit_length()
    density_a = np.fft.rfft(np.diff(anchor, prepend=0.0), size)
    density_o = np.fft.rfft(np.diff(other, prepend=0.0), size)
    density = np.fft.irfft(density_a * density_o ** (k - 1), size)[:total_length]
    tail = np.maximum(np.cumsum(density[::-1])[::-1], 0.0)
    return np.arange(total_length) * _STEP, tail


@lru_cache(maxsize=8)  # of 20 kB; a threshold looks fifty times, and is then kept itself
def _log_tail(k: int, spread: float, limit: float) -> tuple[np.ndarray, np.ndarray]:
    x, tail = _tail(k, spread, limit)
    return x, np.log(np.maximum(tail, 1e-300))


def group_tail(k: int, spread: float, threshold: float) -> float:
    """Chance that one hypothesis of noise reaches the threshold."""
    if k == 1:
        return math.exp(-threshold)
    x, log_tail = _log_tail(k, round(spread, 3), CELL_LIMIT)
    return float(np.exp(np.interp(threshold, x, log_tail)))


_FACTOR_K = np.log(np.array([1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0]))
_FACTOR_LOG = np.log(np.array([19.5, 36.0, 40.0, 46.0, 94.0, 94.0, 56.0, 139.0]))
"""Effective hypotheses per independent cell and interval, by K: calibrated."""
_INTERVAL_POWER = np.array([1.0, 1.40, 1.40, 1.42, 1.36, 1.57, 1.60, 1.60])
"""Exponent of the number of intervals, by K: calibrated."""


def effective_hypotheses(
    *,
    k: int,
    bandwidth_hz: float,
    time_s: float,
    pulse_width_s: float,
    uncertainty_s: float,
    reach_s: float,
) -> float:
    """Effective number of independent hypotheses in a searched volume.

    `bandwidth_hz`, `time_s`: volume for the anchor.
    """
    cells = max(1.0, (bandwidth_hz + 1.0 / pulse_width_s) * time_s)
    width_s = pulse_width_s / 2.0 + reach_s
    intervals = 1.0 + (k - 1) * uncertainty_s / width_s if k > 1 else 1.0
    factor = math.exp(float(np.interp(math.log(k), _FACTOR_K, _FACTOR_LOG)))
    power = float(np.interp(math.log(k), _FACTOR_K, _INTERVAL_POWER))
    return factor * cells * float(intervals**power)


def spread(*, reach_s: float, pulse_width_s: float) -> float:
    """Number of independent exponentials equivalent to a maximum over the jitter."""
    return 1.0 + 2.5 * 2.0 * reach_s / pulse_width_s


@lru_cache(maxsize=1024)
def threshold(*, k: int, hypotheses: float, spread: float, expected_false: float) -> float:
    """Threshold of the sum, in noise powers."""
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

    A tail falls as exp(-T), so an error s of the scale multiplies the false alarms by exp((T
    s)^2 / 2); a factor 1 + T s^2 / 2 compensates. The calibrated factors include the usual
    error.
    """
    more = max(0.0, noise_error**2 - USUAL_NOISE_ERROR**2)
    return 1.0 + 0.5 * threshold * more


def weakest_enr_db(k: int, threshold: float) -> float:
    """ENR [dB] of K equal pulses whose sum reaches a threshold in nine groups of ten.

    A pulse's cell has mean 1 + E and variance 1 + 2 E; their sum is approximated as normal.
    """
    # With x = 1 + 2 E: K (x + 1) / 2 - z sqrt(K x) = threshold, a square equation in sqrt(x).
    half = _NINE_OF_TEN / math.sqrt(k)
    root = half + math.sqrt(max(0.0, half**2 + 2.0 * threshold / k - 1.0))
    return 10.0 * math.log10(max(0.5 * (root**2 - 1.0), 1e-3))
