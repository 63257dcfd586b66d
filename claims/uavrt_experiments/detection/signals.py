"""Channel samples with pulses of known time, frequency and energy, in noise of unit power."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag

THESIS_TAG = Tag(
    tag_id=2,
    frequency_hz=148_710_000.0,
    pulse_width_s=0.020,
    pulse_intervals_s=(1.254,),
    interval_uncertainty_s=0.060,
    interval_jitter_s=0.010,
    k=3,
    false_alarm_probability=0.01,
)
"""The thesis's tag, at the false-alarm probability of the published baselines."""
TRACKER_TAG = Tag(
    tag_id=2,
    frequency_hz=148_710_000.0,
    pulse_width_s=0.015,
    pulse_intervals_s=(1.333,),
    interval_uncertainty_s=0.060,
    interval_jitter_s=0.020,
    k=3,
    false_alarm_probability=0.01,
)
"""Default tag of the original's ground station."""
START_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TruePulse:
    """One generated pulse: the truth."""

    start_s: float
    offset_hz: float
    """Frequency from the channel's centre, at half the pulse's length [Hz]."""
    enr_db: float
    slide_hz: float = 0.0
    """Change of the frequency from the start to the end of the pulse [Hz]."""


def noise(rng: np.random.Generator, count: int) -> NDArray[np.complex64]:
    """White complex noise of unit power, shape (count,)."""
    parts = rng.standard_normal((count, 2), dtype=np.float32)
    parts *= np.float32(math.sqrt(0.5))
    return parts.view(np.complex64).ravel()


def add_pulse(
    samples: NDArray[np.complex64],
    pulse: TruePulse,
    *,
    sample_rate_hz: float,
    width_s: float,
    phase: float,
) -> None:
    """Add a rectangular pulse in place; edge samples get the covered fraction."""
    first = pulse.start_s * sample_rate_hz
    length = width_s * sample_rate_hz
    low, high = math.floor(first), math.ceil(first + length)
    n = np.arange(max(low, 0), min(high, len(samples)))
    if not len(n):
        return
    cover = np.clip(np.minimum(n + 1 - first, first + length - n), 0.0, 1.0)
    amplitude = math.sqrt(10.0 ** (pulse.enr_db / 10.0) / length)
    turn = 2.0 * np.pi * pulse.offset_hz / sample_rate_hz * n + phase
    if pulse.slide_hz:
        turn += (
            np.pi * pulse.slide_hz / width_s * ((n - first) / sample_rate_hz - width_s / 2) ** 2
        )
    samples[n[0] : n[-1] + 1] += (amplitude * cover * np.exp(1j * turn)).astype(np.complex64)


def pulse_train(
    rng: np.random.Generator,
    *,
    duration_s: float,
    interval_s: float,
    offset_hz: float,
    enr_db: float | Callable[[float], float],
    jitter_s: float = 0.0,
    first_s: float | None = None,
    drift_hz_per_s: float = 0.0,
    interval_drift: float = 0.0,
    width_s: float = 0.02,
    slide_hz: float = 0.0,
) -> list[TruePulse]:
    """Make the pulses of a tag over a stretch.

    `duration_s`: length of the stretch [s]; only whole pulses are made.
    `interval_s`: time from pulse start to pulse start [s].
    `offset_hz`: frequency relative to the channel's centre [Hz].
    `enr_db`: ENR [dB], or a function of time that gives it.
    `jitter_s`: largest error of each pulse's time, uniform [s].
    `first_s`: start of the first pulse [s]; None: random within an interval.
    `interval_drift`: relative change of the interval from pulse to pulse.
    """
    at = rng.uniform(0.0, interval_s) if first_s is None else first_s
    pulses = []
    while at + width_s + jitter_s < duration_s:
        start = at + (rng.uniform(-jitter_s, jitter_s) if jitter_s else 0.0)
        if start >= 0.0:
            level = enr_db(start) if callable(enr_db) else enr_db
            pulses.append(
                TruePulse(
                    start_s=start,
                    offset_hz=offset_hz + drift_hz_per_s * start,
                    enr_db=level,
                    slide_hz=slide_hz,
                )
            )
        at += interval_s
        interval_s *= 1.0 + interval_drift
    return pulses


def make_samples(
    rng: np.random.Generator,
    pulses: list[TruePulse],
    *,
    duration_s: float,
    sample_rate_hz: float = 3750.0,
    width_s: float = 0.02,
) -> NDArray[np.complex64]:
    """Noise of unit power with pulses of random phase, shape (duration × rate,)."""
    samples = noise(rng, round(duration_s * sample_rate_hz))
    for pulse in pulses:
        add_pulse(
            samples,
            pulse,
            sample_rate_hz=sample_rate_hz,
            width_s=width_s,
            phase=rng.uniform(0.0, 2.0 * math.pi),
        )
    return samples
