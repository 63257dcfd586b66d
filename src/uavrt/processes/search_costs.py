"""Measure what searching for a tag list costs on this computer, before it starts.

The cost of a tag goes with K, its uncertainty of interval, its width and the window, and with
the computer; so it is measured here, on noise, for a moment: the detectors are run as they will
be, past the time in which they only gather samples.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from uavrt.clock import cpu_s
from uavrt.config import DetectionSettings
from uavrt.detection import DetectorGroup, PulseDetector
from uavrt.messages import Tag
from uavrt.units import ns_from_s

CHEAP_PULSES: Final = 150
"""Tag lists with fewer pulses of all groups together (50 tags of K = 3) are not measured."""
_RATE_HZ: Final = 7500.0
"""Of the channels that the front end makes."""
_BLOCK: Final = 655
_MEASURED_S: Final = 3.0
"""Of signal, some searches of each detector."""
_TOGETHER: Final = 4
_CODE_SHARE: Final = 2e-4
"""Of a core, for each code: 500 take less than a tenth of one."""
_MOST_CPU_S: Final = 2.0
"""So much is spent on measuring; the kinds of tags that are left go with the dearest."""


def search_cost(
    tags: Sequence[Tag],
    *,
    settings: DetectionSettings | None = None,
    most_cpu_s: float = _MOST_CPU_S,
) -> float:
    """Measure what searching for tags will cost.

    Parameters
    ----------
    tags : sequence of Tag
        All that will be searched for.
    settings : DetectionSettings, optional
        How; by default as usual.
    most_cpu_s : float
        CPU time to spend on it [s]: one kind of tag is always measured.

    Returns
    -------
    float
        Processor cores that the detectors need in real time; 0.0 for lists too short to matter.
    """
    codes = sum(tag.coded for tag in tags)
    tags = [tag for tag in tags if not tag.coded]
    if sum(tag.k for tag in tags) < CHEAP_PULSES:
        return codes * _CODE_SHARE
    settings = DetectionSettings() if settings is None else settings
    kinds = Counter(replace(tag, tag_id=2, frequency_hz=1e8, name=None) for tag in tags)
    dearest_first = sorted(kinds, key=lambda kind: -_weight(kind))
    spent_s, cost, share = 0.0, codes * _CODE_SHARE, 0.0
    for kind in dearest_first:
        if spent_s < most_cpu_s:
            begun_s = cpu_s()
            share = _measure(kind, settings)
            spent_s += cpu_s() - begun_s
        cost += kinds[kind] * share
    return cost


def _weight(tag: Tag) -> float:
    """Order of the cost: pulses summed, times the intervals that are tried."""
    return tag.k * (1.0 + 20.0 * tag.interval_uncertainty_s) * len(tag.pulse_intervals_s)


def _measure(tag: Tag, settings: DetectionSettings) -> float:
    """Run some detectors of a kind on noise; the cores that each needs."""
    rng = np.random.default_rng(1)
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
            for number in range(_TOGETHER)
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
        group.put(0, noise, ns_from_s(at / _RATE_HZ))
        group.collect()
        at += _BLOCK
    return (cpu_s() - begun_s) / ((at - begun_at) / _RATE_HZ) / _TOGETHER
