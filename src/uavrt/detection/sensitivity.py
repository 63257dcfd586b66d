"""Compute the pulse strength needed for the search to find a group.

The model is a noncoherent square-law detector (Marcum 1960, IRE Trans. IT-6): the power of a
pulse's cell over the noise is half a noncentral chi-square of two degrees of freedom. A group
is the sum of one such cell and K - 1 maxima, each of a pulse's cell and the noise cells within
the jitter. The threshold is the search's own, with all its hypotheses.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.stats import ncx2

from uavrt.core.messages import Tag
from uavrt.detection.coded.limits import sum_limit
from uavrt.detection.coded.tuning import LIMITS
from uavrt.detection.search.grid import HOPS_PER_PULSE
from uavrt.detection.search.hypotheses import jitter_reach
from uavrt.detection.search.thresholds import (
    decision_interval_s,
    effective_hypotheses,
    finer_times,
    spread,
    threshold,
)
from uavrt.detection.search.tuning import GROUPS


@dataclass(frozen=True, slots=True, kw_only=True)
class SensitivityTuning:
    """Measured differences between the computed and the experimental sensitivity."""

    ks: tuple[float, ...] = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0)
    """Numbers of pulses K for which `gains_db` are given."""
    gains_db: tuple[float, ...] = (0.1, 0.6, 0.45, 0.75, 0.95, 1.15, 1.35, 1.05)
    """Measured gain per pulse by K [dB]; the detector chooses the best of overlapping cells,
    which the model ignores."""
    bursts: tuple[float, ...] = (1.0, 3.0, 10.0)
    """Numbers of bursts for which `losses_db` are given."""
    losses_db: tuple[float, ...] = (0.2, -0.1, 0.2)
    """Measured loss of a coded tag's sums, by number of bursts summed (experiment E23) [dB]."""
    step: float = 0.02
    """Resolution of the calculated distributions of the cells' power [noise powers]."""


SENSITIVITY = SensitivityTuning()


def group_threshold(tag: Tag, *, frequency_window_hz: float, sample_rate_hz: float) -> float:
    """Minimum sum of K cells of a group at the tag's first rate [noise powers]."""
    hop_s = tag.pulse_width_s / HOPS_PER_PULSE
    reach_s = jitter_reach(tag.interval_jitter_s, hop_s) * hop_s
    return threshold(
        k=tag.k,
        hypotheses=effective_hypotheses(
            k=tag.k,
            bandwidth_hz=min(2.0 * frequency_window_hz, sample_rate_hz),
            time_s=decision_interval_s(tag),
            pulse_width_s=tag.pulse_width_s,
            uncertainty_s=tag.interval_uncertainty_s,
            reach_s=reach_s,
            finer=finer_times(tag),
        ),
        spread=spread(tag, reach_s=reach_s),
        expected_false=tag.false_alarm_probability / len(tag.pulse_intervals_s),
    )


def detection_probability(
    tag: Tag,
    enr_db: float,
    *,
    frequency_window_hz: float = 500.0,
    sample_rate_hz: float = 3750.0,
) -> float:
    """Probability that one group of K equally strong pulses, or of K coded bursts, is found.

    Parameters
    ----------
    tag : Tag
    enr_db : float
        Energy of a pulse over the noise density [dB].
    frequency_window_hz : float
        Largest offset from the nominal frequency that is searched [Hz].
    sample_rate_hz : float
        Sample rate of the tag's channel [Hz]; it limits the searched band.
    """
    if tag.coded:
        bandwidth_hz = min(2.0 * frequency_window_hz, sample_rate_hz)
        return _coded_probability(tag, enr_db, bandwidth_hz)
    limit = group_threshold(
        tag, frequency_window_hz=frequency_window_hz, sample_rate_hz=sample_rate_hz
    )
    hop_s = tag.pulse_width_s / HOPS_PER_PULSE
    reach_s = jitter_reach(tag.interval_jitter_s, hop_s) * hop_s
    others = spread(tag, reach_s=reach_s) - 1.0
    gained_db = float(np.interp(math.log(tag.k), np.log(SENSITIVITY.ks), SENSITIVITY.gains_db))
    return _passes(tag.k, round(others, 6), round(enr_db + gained_db, 3), limit)


def _coded_probability(tag: Tag, enr_db: float, bandwidth_hz: float) -> float:
    """Probability that a coded tag is found by one of K bursts, or by a sum of three or all."""
    pulses = len(tag.gaps_s) + 1

    def together(bursts: int) -> float:
        limit = sum_limit(
            tag,
            bandwidth_hz=bandwidth_hz,
            bursts=bursts,
            pulses=bursts * pulses,
            false_per_hour=LIMITS.false_per_hour,
        )
        lost_db = float(
            np.interp(math.log(bursts), np.log(SENSITIVITY.bursts), SENSITIVITY.losses_db)
        )
        energy = bursts * pulses * math.pow(10.0, (enr_db - lost_db) / 10.0)
        return float(ncx2.sf(2.0 * limit, 2 * bursts * pulses, 2.0 * energy))

    found = [1.0 - (1.0 - together(1)) ** tag.k, together(max(1, tag.k))]
    return max([*found, together(3)] if tag.k >= 3 else found)


@lru_cache(maxsize=4096)
def _passes(k: int, others: float, enr_db: float, limit: float) -> float:
    """Probability that the powers of a group of K pulses reach the sum `limit` [noise powers].

    The first power is that of a pulse's cell. Each other is the maximum of a pulse's cell and
    `others` noise cells.
    """
    energy = math.pow(10.0, enr_db / 10.0)
    if k == 1:
        return float(ncx2.sf(2.0 * limit, 2, 2.0 * energy))
    cells = np.arange(0.0, GROUPS.cell_limit + SENSITIVITY.step, SENSITIVITY.step)
    pulse = ncx2.cdf(2.0 * cells, 2, 2.0 * energy)
    best = pulse * (-np.expm1(-cells)) ** others
    pulse[-1] = best[-1] = 1.0  # stronger cells count as much as the limit
    anchor, best = np.diff(pulse), np.diff(best)
    size = next_fast_len(k * len(cells), real=True)
    below = irfft(rfft(anchor, size) * rfft(best, size) ** (k - 1), size)
    # Each cell lies half a step above its bin's lower edge.
    return float(1.0 - below[: max(0, round(limit / SENSITIVITY.step - 0.5 * k))].sum())


def enr_needed_db(
    tag: Tag,
    probability: float,
    *,
    frequency_window_hz: float = 500.0,
    sample_rate_hz: float = 3750.0,
) -> float:
    """ENR at which a group is found with a given probability, between 0 and 1 [dB]."""
    low, high = -30.0, 60.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        found = detection_probability(
            tag, middle, frequency_window_hz=frequency_window_hz, sample_rate_hz=sample_rate_hz
        )
        low, high = (middle, high) if found < probability else (low, middle)
    return high


def gain_in_words(before: Tag, after: Tag) -> str:
    """Sentence on the sensitivity gained by a corrected interval; empty if negligible."""
    if replace(before, frequency_hz=after.frequency_hz) == after:
        return ""
    gained_db = enr_needed_db(before, 0.5) - enr_needed_db(after, 0.5)
    return f". Pulses {gained_db:.1f} dB weaker are found" if gained_db > 0.05 else ""
