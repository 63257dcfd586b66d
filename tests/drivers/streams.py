"""Streams of samples for tests of detectors: a tag's pulses in noise, fed block by block."""

from collections.abc import Callable, Iterable
from typing import Any

import made
import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Pulse
from uavrt.detection.detector import PulseDetector
from uavrt.detection.signal.carrier_lines import LineCanceller
from uavrt_experiments.detection.signals import START_NS, TruePulse, add_pulse, make_samples
from uavrt_experiments.detection.trials import BLOCK_SAMPLES, RATE_HZ, blocks_of

Samples = NDArray[np.complex64]


def sent(
    seed: int | tuple[int, ...],
    duration_s: float,
    enr_db: float | Callable[[float], float],
    *,
    rate_hz: float = RATE_HZ,
    **train: Any,
) -> tuple[list[TruePulse], Samples]:
    """Make the pulses of a tag, and samples of them in white noise."""
    rng = np.random.default_rng(seed)
    truth = made.train(rng, duration_s, enr_db, **train)
    return truth, make_samples(rng, truth, duration_s=duration_s, sample_rate_hz=rate_hz)


def add_pulses(
    samples: Samples,
    pulses: Iterable[TruePulse],
    *,
    rate_hz: float = RATE_HZ,
    rng: np.random.Generator | None = None,
) -> None:
    """Add pulses of 20 ms in place, of random phases if there is a generator."""
    for pulse in pulses:
        phase = 1.0 if rng is None else rng.uniform(0.0, 2.0 * np.pi)
        add_pulse(samples, pulse, sample_rate_hz=rate_hz, width_s=0.02, phase=phase)


def fed(
    detector: PulseDetector,
    samples: Samples,
    *,
    rate_hz: float = RATE_HZ,
    block: int = BLOCK_SAMPLES,
    start_ns: int = START_NS,
) -> list[Pulse]:
    """Feed a detector block by block; get what it reported before its flush."""
    parts = blocks_of(samples, sample_rate_hz=rate_hz, block=block, start_ns=start_ns)
    return [pulse for part, time_ns in parts for pulse in detector.process(part, time_ns)]


def start_s(pulse: Pulse) -> float:
    """Time of a pulse since the start of the stream [s]."""
    return (pulse.start_time_ns - START_NS) * 1e-9


def cancel_lines(canceller: LineCanceller, samples: Samples, step: int) -> list[list[float]]:
    """Subtract carriers from samples in place; give those held after each step [Hz]."""
    held = []
    for first in range(0, len(samples), step):
        new = samples[first : first + step]
        before = samples[max(0, first - canceller.needed) : first]
        canceller.find(before, new)
        canceller.subtract(before, new)
        held.append([float(hz) for hz in canceller.frequencies_hz])
    return held
