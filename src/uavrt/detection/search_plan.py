"""Plan the search for a list of tags: radio frequency, channels, cost.

The drone does this at the start of a flight, and `uavrt tags check` does it on request.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from uavrt.config.settings import DetectionSettings
from uavrt.core.errors import TunerError
from uavrt.core.messages import Tag
from uavrt.detection.detector_checks import check_searchable
from uavrt.detection.modes import OperatingMode
from uavrt.detection.search_costs import search_cost
from uavrt.dsp.plan import UNDECIMATED_FRACTION, BandPlan, plan_band
from uavrt.dsp.tuner import tune

_SPANNED = (OperatingMode.ALL_NEVER_LOCK.value, OperatingMode.KNOWN_HARD_LOCK.value)
"""Modes whose band does not depend on the search window: whole channel or ± 100 Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchPlan:
    """Result of planning the search for a list of tags."""

    center_frequency_hz: float
    """Frequency to which the radio is tuned [Hz]."""
    warnings: tuple[str, ...]
    """Sentences for the operator on limitations that these tags make unavoidable."""
    cores: float
    """Cores that the detectors need; uncoded tags too cheap to measure count 0."""


def plan_search(
    tags: Sequence[Tag],
    cpu_s: Callable[[], float],
    *,
    sample_rate_hz: float,
    detection: DetectionSettings,
    center_frequency_hz: float | None = None,
    spare_cores: float = math.inf,
) -> SearchPlan:
    """Choose the radio's frequency for a list of tags; refuse lists that cannot be searched.

    With `center_frequency_hz`, tags out of its range are left out. `cpu_s` returns processor
    time used so far [s], to measure the cost of a long list.
    """
    warnings: tuple[str, ...] = ()
    if center_frequency_hz is None:
        tuned = tune([tag.frequency_hz for tag in tags], sample_rate_hz=sample_rate_hz)
        center_frequency_hz, warnings = tuned.center_frequency_hz, tuned.warnings
    reach_hz = UNDECIMATED_FRACTION * sample_rate_hz
    received = [tag for tag in tags if abs(tag.frequency_hz - center_frequency_hz) <= reach_hz]
    farthest = [abs(tag.frequency_hz - center_frequency_hz) for tag in received]
    band = plan_band(sample_rate_hz, reach_hz=max(farthest, default=0.0))
    for tag in received:
        _check_window(tag, center_frequency_hz, band, detection)
    cores = search_cost(received, cpu_s, settings=detection)
    if cores > spare_cores:
        raise TunerError(
            f"the search for these {len(received)} tags needs {cores:.1f} processor "
            f"cores, but only {spare_cores:g} are available",
            remedy="Send fewer tags, or give them a smaller K or interval uncertainty",
        )
    return SearchPlan(center_frequency_hz=center_frequency_hz, warnings=warnings, cores=cores)


def _check_window(
    tag: Tag, center_hz: float, band: BandPlan, detection: DetectionSettings
) -> None:
    window_hz = detection.frequency_window_hz
    if detection.operating_mode in _SPANNED:
        window_hz = min(window_hz, 100.0)
    offset_hz = band.offset_hz(tag.frequency_hz - center_hz)
    check_searchable(tag, band.channel_rate_hz, tag.frequency_hz - offset_hz, window_hz)
