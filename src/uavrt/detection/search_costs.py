"""Measure how much CPU time the search for a tag list needs on this computer.

The cost grows with K², the interval's uncertainty and the search window. Before the search,
detectors run for a short time on noise and simulated pulses of the tag.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.config.settings import DetectionSettings
from uavrt.core.messages import Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt.detection.modes import OperatingMode


@dataclass(frozen=True, slots=True, kw_only=True)
class CostTuning:
    """Constants for estimating and measuring the cost of a search."""

    cheap_tags: int = 50
    """Estimated cost of a tag list up to which it is not measured [costs of a typical tag]; it
    is a fifth of a core."""
    typical_weight: float = 3**2 * 0.06 * 1000.0
    """Cost of a typical tag: product of K² = 9, the interval's uncertainty of 60 ms in seconds,
    and the window's half-width of 500 Hz in hertz."""
    least_uncertainty_s: float = 0.003
    """Minimum uncertainty of a pulse interval used in the estimated search cost [s]."""
    rate_hz: float = 7500.0
    """Sample rate of the channels on which search costs are measured [Hz]."""
    block: int = 655
    """Length of a block of the signal on which search costs are measured [samples]."""
    measured_s: float = 3.0
    """Length of the signal on which search costs are measured [s]."""
    together: int = 4
    """Number of equal detectors that run together while their search cost is measured."""
    dear_weight: float = 10.0
    """Minimum cost of a tag that is measured separately [multiples of a typical tag's cost]."""
    received_enr: float = 40.0
    """Energy of the simulated tag's pulses over the noise density (ENR), not in decibels."""
    code_share: float = 2e-4
    """Share of a core for each coded tag; 500 tags take less than a tenth of a core."""
    most_cpu_s: float = 2.0
    """Maximum CPU time for measuring [s]; further tags are assumed to cost as much as the last
    measured."""


COSTS = CostTuning()


def search_cost(
    tags: Sequence[Tag],
    cpu_s: Callable[[], float],
    *,
    settings: DetectionSettings | None = None,
) -> float:
    """Measure how many processor cores the search for tags needs.

    Uncoded tags count as 0.0 if their estimated cost is small in total.
    """
    codes = sum(tag.coded for tag in tags)
    tags = [tag for tag in tags if not tag.coded]
    settings = DetectionSettings() if settings is None else settings
    if sum(_weight(tag, settings) for tag in tags) < COSTS.cheap_tags:
        return codes * COSTS.code_share
    kinds = Counter(replace(tag, tag_id=2, frequency_hz=1e8, name=None) for tag in tags)
    dearest_first = sorted(kinds, key=lambda kind: -_weight(kind, settings))
    spent_s, cost, share = 0.0, codes * COSTS.code_share, 0.0
    more = 0.0
    for kind in dearest_first:
        if spent_s < COSTS.most_cpu_s:
            begun_s = cpu_s()
            share = _measure(kind, settings, cpu_s, heard=False)
            more = max(0.0, _measure(kind, settings, cpu_s, heard=True) - share)
            spent_s += cpu_s() - begun_s
        cost += kinds[kind] * share + more
    return cost


def _weight(tag: Tag, settings: DetectionSettings) -> float:
    """Estimate a tag's search cost [typical tags] from the intervals and frequencies tried."""
    whole = settings.operating_mode == OperatingMode.ALL_NEVER_LOCK.value
    width_hz = (
        COSTS.rate_hz if whole else min(2.0 * settings.frequency_window_hz, COSTS.rate_hz)
    )
    uncertainty_s = max(tag.interval_uncertainty_s, COSTS.least_uncertainty_s)
    rates = len(tag.pulse_intervals_s)
    return tag.k**2 * uncertainty_s * width_hz * rates / COSTS.typical_weight


def _measure(
    tag: Tag, settings: DetectionSettings, cpu_s: Callable[[], float], *, heard: bool
) -> float:
    """Measure the cores used by each detector, on noise or, with `heard`, on tag pulses."""
    rng = np.random.default_rng(1)
    together = 1 if heard or _weight(tag, settings) > COSTS.dear_weight else COSTS.together
    group = DetectorGroup()
    group.add(
        0,
        [
            PulseDetector(
                replace(
                    tag, tag_id=2 + 2 * number, frequency_hz=tag.frequency_hz + 1e-3 * number
                ),
                sample_rate_hz=COSTS.rate_hz,
                center_frequency_hz=tag.frequency_hz,
                frequency_window_hz=settings.frequency_window_hz,
                operating_mode=settings.operating_mode,
            )
            for number in range(together)
        ],
    )
    longest_s = max(tag.pulse_intervals_s) + tag.interval_uncertainty_s
    warm_s = (tag.k + 1) * longest_s
    begun_s, begun_at, at = cpu_s(), 0, 0
    first_s, warm_at = begun_s, warm_s * COSTS.rate_hz
    while (
        at < warm_at + COSTS.measured_s * COSTS.rate_hz and cpu_s() - first_s < COSTS.most_cpu_s
    ):
        if not begun_at and at >= warm_at:
            begun_at, begun_s = at, cpu_s()
        noise = rng.standard_normal((COSTS.block, 2), np.float32).view(np.complex64)[:, 0]
        if heard:
            noise += _pulses(tag, at)
        group.put(0, noise, ns_from_s(at / COSTS.rate_hz))
        group.collect()
        at += COSTS.block
    return (cpu_s() - begun_s) / ((at - begun_at) / COSTS.rate_hz) / together


def _pulses(tag: Tag, at: int) -> NDArray[np.complex64]:
    seconds = (at + np.arange(COSTS.block)) / COSTS.rate_hz
    sent = seconds % tag.pulse_intervals_s[0] < tag.pulse_width_s
    # Noise of variance 2: a pulse's energy over it is its ENR.
    amplitude = np.sqrt(2.0 * COSTS.received_enr / (tag.pulse_width_s * COSTS.rate_hz))
    return np.where(sent, amplitude, 0.0).astype(np.complex64)
