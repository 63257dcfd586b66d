"""Measure the cost of searching for a tag list on this computer, before the search starts.

The cost grows with the square of K, with the uncertainty of the interval and with the window.
So the detectors are run for a moment on noise and on the tag's own pulses.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.config.settings import DetectionSettings
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt.detection.modes import OperatingMode
from uavrt.messages import Tag
from uavrt.units import ns_from_s

CHEAP_TAGS: Final = 50
"""Cost up to which a list is not measured, in typical tags (K = 3, ± 60 ms, ± 500 Hz); so many
take a fifth of a core here."""
_USUAL: Final = 3**2 * 0.06 * 1000.0
"""K², uncertainty [s] and search width [Hz] of a typical tag."""
_LEAST_UNCERTAINTY_S: Final = 0.003
_RATE_HZ: Final = 7500.0
"""Sample rate of the channels [Hz]."""
_BLOCK: Final = 655
_MEASURED_S: Final = 3.0
"""Length of the measured signal [s], for some searches by each detector."""
_TOGETHER: Final = 4
_DEAR: Final = 10.0
"""Least cost of a tag that is measured separately, in typical tags."""
_HEARD_POWER: Final = 40.0
"""ENR of the pulses of a tag in reception."""
_CODE_SHARE: Final = 2e-4
"""Share of a core for each code; 500 take less than a tenth."""
_MOST_CPU_S: Final = 2.0
"""Longest measurement [s of CPU]; further kinds of tags count as the most expensive
measured."""


def search_cost(
    tags: Sequence[Tag],
    cpu_s: Callable[[], float],
    *,
    settings: DetectionSettings | None = None,
) -> float:
    """Measure the cost of searching for tags.

    Returns processor cores needed in real time while one tag of each kind is received; 0.0 for
    lists too cheap to matter.
    """
    codes = sum(tag.coded for tag in tags)
    tags = [tag for tag in tags if not tag.coded]
    settings = DetectionSettings() if settings is None else settings
    if sum(_weight(tag, settings) for tag in tags) < CHEAP_TAGS:
        return codes * _CODE_SHARE
    kinds = Counter(replace(tag, tag_id=2, frequency_hz=1e8, name=None) for tag in tags)
    dearest_first = sorted(kinds, key=lambda kind: -_weight(kind, settings))
    spent_s, cost, share = 0.0, codes * _CODE_SHARE, 0.0
    more = 0.0
    for kind in dearest_first:
        if spent_s < _MOST_CPU_S:
            begun_s = cpu_s()
            share = _measure(kind, settings, cpu_s, heard=False)
            more = max(0.0, _measure(kind, settings, cpu_s, heard=True) - share)
            spent_s += cpu_s() - begun_s
        cost += kinds[kind] * share + more
    return cost


def _weight(tag: Tag, settings: DetectionSettings) -> float:
    """Estimate a tag's cost in typical tags: intervals times frequencies tried."""
    whole = settings.operating_mode == OperatingMode.ALL_NEVER_LOCK.value
    width_hz = _RATE_HZ if whole else min(2.0 * settings.frequency_window_hz, _RATE_HZ)
    uncertainty_s = max(tag.interval_uncertainty_s, _LEAST_UNCERTAINTY_S)
    rates = len(tag.pulse_intervals_s)
    return tag.k**2 * uncertainty_s * width_hz * rates / _USUAL


def _measure(
    tag: Tag, settings: DetectionSettings, cpu_s: Callable[[], float], *, heard: bool
) -> float:
    """Run some detectors of a kind on noise, or one on its tag; return the cores for each."""
    rng = np.random.default_rng(1)
    together = 1 if heard or _weight(tag, settings) > _DEAR else _TOGETHER
    group = DetectorGroup()
    group.add(
        0,
        [
            PulseDetector(
                replace(
                    tag, tag_id=2 + 2 * number, frequency_hz=tag.frequency_hz + 1e-3 * number
                ),
                sample_rate_hz=_RATE_HZ,
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
    first_s, warm_at = begun_s, warm_s * _RATE_HZ
    while at < warm_at + _MEASURED_S * _RATE_HZ and cpu_s() - first_s < _MOST_CPU_S:
        if not begun_at and at >= warm_at:
            begun_at, begun_s = at, cpu_s()
        noise = rng.standard_normal((_BLOCK, 2), np.float32).view(np.complex64)[:, 0]
        if heard:
            noise += _pulses(tag, at)
        group.put(0, noise, ns_from_s(at / _RATE_HZ))
        group.collect()
        at += _BLOCK
    return (cpu_s() - begun_s) / ((at - begun_at) / _RATE_HZ) / together


def _pulses(tag: Tag, at: int) -> NDArray[np.complex64]:
    """Samples of a tag's pulses at the channel's centre, from a position on."""
    seconds = (at + np.arange(_BLOCK)) / _RATE_HZ
    sent = seconds % tag.pulse_intervals_s[0] < tag.pulse_width_s
    # Noise of variance 2: a pulse's energy over it is its ENR.
    amplitude = np.sqrt(2.0 * _HEARD_POWER / (tag.pulse_width_s * _RATE_HZ))
    return np.where(sent, amplitude, 0.0).astype(np.complex64)
