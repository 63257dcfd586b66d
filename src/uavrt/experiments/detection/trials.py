"""Trials of the detector: one decision, or a long stretch, against the truth."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavrt.detection import OperatingMode, PulseDetector
from uavrt.detection.thresholds import decision_span_s
from uavrt.experiments.detection.signals import (
    START_NS,
    TruePulse,
    make_samples,
    pulse_train,
)
from uavrt.messages import Pulse, Tag

BLOCK_SAMPLES = 653
"""About 87 ms of a 7.5 kS/s channel: how samples arrive in a flight."""


def detect(
    samples: NDArray[np.complex64],
    tag: Tag,
    *,
    sample_rate_hz: float = 3750.0,
    center_frequency_hz: float | None = None,
    frequency_window_hz: float = 1e6,
    operating_mode: OperatingMode = OperatingMode.SEARCH_SOFT_LOCK,
    block: int = BLOCK_SAMPLES,
    start_ns: int = START_NS,
) -> tuple[list[Pulse], PulseDetector]:
    """Run a detector over samples, in blocks; its pulses and the detector itself."""
    detector = PulseDetector(
        tag,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=(
            tag.frequency_hz if center_frequency_hz is None else center_frequency_hz
        ),
        frequency_window_hz=frequency_window_hz,
        operating_mode=operating_mode,
    )
    pulses: list[Pulse] = []
    for first in range(0, len(samples), block):
        time_ns = start_ns + round(first / sample_rate_hz * 1e9)
        pulses += detector.process(samples[first : first + block], time_ns)
    pulses += detector.flush()
    return pulses, detector


@dataclass(slots=True)
class Comparison:
    """Reported pulses against the true ones."""

    true: int = 0
    matched: int = 0
    """True pulses with any report within 0.75 of a pulse width."""
    confirmed: int = 0
    """True pulses with a confirmed report there."""
    false: int = 0
    false_confirmed: int = 0
    time_errors_s: list[float] = field(default_factory=list)
    frequency_errors_hz: list[float] = field(default_factory=list)
    snr_errors_db: list[float] = field(default_factory=list)
    found: list[bool] = field(default_factory=list)


def compare(
    pulses: list[Pulse],
    truth: list[TruePulse],
    tag: Tag,
    *,
    start_ns: int = START_NS,
    center_frequency_hz: float | None = None,
    confirmed_errors_only: bool = False,
) -> Comparison:
    """Match reports with true pulses: within 0.75 of a pulse width and 50 Hz."""
    center = tag.frequency_hz if center_frequency_hz is None else center_frequency_hz
    result = Comparison(true=len(truth), found=[False] * len(truth))
    starts = np.array([pulse.start_s for pulse in truth])
    seen: set[int] = set()
    sure: set[int] = set()
    for pulse in pulses:
        at_s = (pulse.start_time_ns - start_ns) * 1e-9
        index = int(np.abs(starts - at_s).argmin()) if len(starts) else -1
        true = truth[index] if index >= 0 else None
        if (
            true is not None
            and abs(at_s - true.start_s) <= 0.75 * tag.pulse_width_s
            and abs(pulse.frequency_hz - center - true.offset_hz) <= 50.0
        ):
            seen.add(index)
            result.found[index] = True
            if pulse.confirmed:
                sure.add(index)
            if pulse.confirmed or not confirmed_errors_only:
                result.time_errors_s.append(at_s - true.start_s)
                result.frequency_errors_hz.append(pulse.frequency_hz - center - true.offset_hz)
                result.snr_errors_db.append(pulse.snr_db - true.enr_db)
        else:
            result.false += 1
            result.false_confirmed += pulse.confirmed
    result.matched, result.confirmed = len(seen), len(sure)
    return result


def detected_once(
    rng: np.random.Generator,
    tag: Tag,
    enr_db: float,
    *,
    sample_rate_hz: float = 3750.0,
    frequency_window_hz: float = 1e6,
    band_hz: float = 1500.0,
) -> bool:
    """One decision of reference/detector.md §9: a fresh stretch, is the group found?

    Random phases, start, and frequency in ± `band_hz`; jitter of half the tag's bound; found
    is a group with all frequencies within 50 Hz and at least half of its pulses in place.
    """
    duration_s = decision_span_s(tag)
    spread = tag.interval_uncertainty_s
    truth = pulse_train(
        rng,
        duration_s=duration_s,
        interval_s=tag.pulse_intervals_s[0] + rng.uniform(-0.8, 0.8) * spread,
        offset_hz=rng.uniform(-band_hz, band_hz),
        enr_db=enr_db,
        jitter_s=tag.interval_jitter_s / 2.0,
        width_s=tag.pulse_width_s,
    )
    samples = make_samples(
        rng,
        truth,
        duration_s=duration_s,
        sample_rate_hz=sample_rate_hz,
        width_s=tag.pulse_width_s,
    )
    pulses, _ = detect(
        samples,
        tag,
        sample_rate_hz=sample_rate_hz,
        frequency_window_hz=frequency_window_hz,
    )
    groups: dict[int, list[Pulse]] = {}
    for pulse in pulses:
        groups.setdefault(pulse.group_sequence, []).append(pulse)
    for group in groups.values():
        comparison = compare(group, truth, tag)
        if comparison.matched * 2 >= len(group) and all(
            abs(p.frequency_hz - tag.frequency_hz - truth[0].offset_hz) <= 50.0 for p in group
        ):
            return True
    return False
