"""Trials of the detector: one decision, or a long stretch, against the truth."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.detector import PulseDetector
from uavrt.detection.modes import OperatingMode
from uavrt.detection.search.thresholds import decision_span_s
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    make_samples,
    pulse_train,
)

Samples = NDArray[np.complex64]
BLOCK_SAMPLES = 653
"""Number of samples in a block, as they arrive in a flight: about 87 ms at 7.5 kS/s."""
RATE_HZ = 3750.0
"""Rate of the original's channels [Hz], and the default of all trials."""
WHOLE_CHANNEL_HZ = math.inf
_RICIAN = 10.0**0.6
"""Power ratio of the steady part to the fading one, 6 dB."""
_RAMP_DB_PER_PULSE = 3.0


def blocks_of(
    samples: Samples,
    *,
    sample_rate_hz: float = RATE_HZ,
    block: int = BLOCK_SAMPLES,
    start_ns: int = START_NS,
) -> Iterator[tuple[Samples, int]]:
    """Cut samples into blocks with the times of their first samples."""
    for first in range(0, len(samples), block):
        yield (samples[first : first + block], start_ns + ns_from_s(first / sample_rate_hz))


def detect_blocks(
    blocks: Iterable[tuple[Samples, int]],
    tag: Tag,
    *,
    sample_rate_hz: float = RATE_HZ,
    center_frequency_hz: float | None = None,
    frequency_window_hz: float = WHOLE_CHANNEL_HZ,
    operating_mode: OperatingMode = OperatingMode.SEARCH_SOFT_LOCK,
) -> tuple[list[Pulse], PulseDetector]:
    """Run a detector over blocks with given times; returns its pulses and the detector."""
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
    for samples, time_ns in blocks:
        pulses += detector.process(samples, time_ns)
    pulses += detector.flush()
    return pulses, detector


def detect(
    samples: Samples,
    tag: Tag,
    *,
    sample_rate_hz: float = RATE_HZ,
    center_frequency_hz: float | None = None,
    frequency_window_hz: float = WHOLE_CHANNEL_HZ,
    operating_mode: OperatingMode = OperatingMode.SEARCH_SOFT_LOCK,
    block: int = BLOCK_SAMPLES,
    start_ns: int = START_NS,
) -> tuple[list[Pulse], PulseDetector]:
    """Run a detector over samples, in blocks; returns its pulses and the detector."""
    return detect_blocks(
        blocks_of(samples, sample_rate_hz=sample_rate_hz, block=block, start_ns=start_ns),
        tag,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=center_frequency_hz,
        frequency_window_hz=frequency_window_hz,
        operating_mode=operating_mode,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Emission:
    """A record of the detector, and the amount of the stream that preceded it [s]."""

    pulse: Pulse
    at_s: float


def emissions(
    samples: Samples,
    tag: Tag,
    *,
    sample_rate_hz: float = RATE_HZ,
    frequency_window_hz: float = WHOLE_CHANNEL_HZ,
    block: int = BLOCK_SAMPLES,
) -> list[Emission]:
    """Records of a detector, each with the stream's time at which it was emitted."""
    detector = PulseDetector(
        tag,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=tag.frequency_hz,
        frequency_window_hz=frequency_window_hz,
    )
    records: list[Emission] = []
    done = 0
    for part, time_ns in blocks_of(samples, sample_rate_hz=sample_rate_hz, block=block):
        done += len(part)
        at_s = done / sample_rate_hz
        records += [Emission(pulse=p, at_s=at_s) for p in detector.process(part, time_ns)]
    return records


@dataclass(slots=True)
class Comparison:
    """Number of reported pulses that match the true ones, and their errors."""

    true: int = 0
    matched: int = 0
    """Number of true pulses with any report within 0.75 of a pulse width."""
    confirmed: int = 0
    """Number of true pulses with a confirmed report within 0.75 of a pulse width."""
    false: int = 0
    false_confirmed: int = 0
    time_errors_s: list[float] = field(default_factory=list)
    frequency_errors_hz: list[float] = field(default_factory=list)
    snr_errors_db: list[float] = field(default_factory=list)
    found: list[bool] = field(default_factory=list)
    sure: list[bool] = field(default_factory=list)
    """For each true pulse: true if it was found, and true if it was confirmed."""
    levels_db: list[float] = field(default_factory=list)
    """ENR of each true pulse [dB]."""


def compare(
    pulses: Sequence[Pulse],
    truth: Sequence[TruePulse],
    tag: Tag,
    *,
    start_ns: int = START_NS,
    center_frequency_hz: float | None = None,
    confirmed_errors_only: bool = False,
) -> Comparison:
    """Match reports with true pulses, within 0.75 of a pulse width and 50 Hz."""
    center = tag.frequency_hz if center_frequency_hz is None else center_frequency_hz
    count = len(truth)
    result = Comparison(true=count, found=[False] * count, sure=[False] * count)
    result.levels_db = [pulse.enr_db for pulse in truth]
    starts = np.array([pulse.start_s for pulse in truth])
    for pulse in pulses:
        at_s = (pulse.start_time_ns - start_ns) * 1e-9
        index = int(np.abs(starts - at_s).argmin()) if count else -1
        true = truth[index] if index >= 0 else None
        if (
            true is not None
            and abs(at_s - true.start_s) <= 0.75 * tag.pulse_width_s
            and abs(pulse.frequency_hz - center - true.offset_hz) <= 50.0
        ):
            result.found[index] = True
            result.sure[index] |= pulse.confirmed
            if pulse.confirmed or not confirmed_errors_only:
                result.time_errors_s.append(at_s - true.start_s)
                result.frequency_errors_hz.append(pulse.frequency_hz - center - true.offset_hz)
                result.snr_errors_db.append(pulse.snr_db - true.enr_db)
        else:
            result.false += 1
            result.false_confirmed += pulse.confirmed
    result.matched, result.confirmed = sum(result.found), sum(result.sure)
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Stretches of samples with one decision each, like the original's segments."""

    tag: Tag = THESIS_TAG
    frequency_window_hz: float = WHOLE_CHANNEL_HZ
    band_hz: float = 1500.0
    """Half-width of the range of the tag's frequency [Hz]."""
    interval_error: float = 0.8
    """Largest error of the interval, as a share of the tag's bound."""
    jitter: float = 0.5
    """Largest jitter of a pulse, as a share of the tag's bound."""
    interval_drift: float = 0.0
    """Relative change of the interval from pulse to pulse, with random sign."""
    drift_hz_per_s: float = 0.0
    """Drift of the frequency [Hz/s], with random sign."""
    strength: Literal["steady", "rician", "ramp"] = "steady"

    def stretch(
        self, rng: np.random.Generator, enr_db: float
    ) -> tuple[Samples, list[TruePulse]]:
        """Samples with one tag of random phases, start, frequency and interval, and
        the truth.
        """
        tag = self.tag
        duration_s = decision_span_s(tag)
        sign = float(rng.choice((-1.0, 1.0)))
        error = self.interval_error * tag.interval_uncertainty_s
        drift = sign * self.drift_hz_per_s
        truth = pulse_train(
            rng,
            duration_s=duration_s,
            interval_s=tag.pulse_intervals_s[0] + rng.uniform(-error, error),
            offset_hz=rng.uniform(-self.band_hz, self.band_hz) - drift * duration_s / 2.0,
            enr_db=self._level(rng, enr_db, duration_s),
            jitter_s=self.jitter * tag.interval_jitter_s,
            drift_hz_per_s=drift,
            interval_drift=sign * self.interval_drift,
            width_s=tag.pulse_width_s,
        )
        samples = make_samples(rng, truth, duration_s=duration_s, width_s=tag.pulse_width_s)
        return samples, truth

    def found(self, rng: np.random.Generator, enr_db: float) -> bool:
        """True if a new detector finds the group in a new stretch."""
        samples, truth = self.stretch(rng, enr_db)
        pulses, _ = detect(samples, self.tag, frequency_window_hz=self.frequency_window_hz)
        return group_found(pulses, truth, self.tag)

    def _level(
        self, rng: np.random.Generator, enr_db: float, duration_s: float
    ) -> float | Callable[[float], float]:
        """ENR of a pulse at a time [dB]; the mean power is that of `enr_db`."""
        if self.strength == "steady":
            return enr_db
        if self.strength == "ramp":
            slope = float(rng.choice((-1.0, 1.0))) * _RAMP_DB_PER_PULSE
            slope /= self.tag.pulse_intervals_s[0]
            return lambda time_s: enr_db + slope * (time_s - duration_s / 2.0)

        def fading(_: float) -> float:
            steady = math.sqrt(_RICIAN / (1.0 + _RICIAN))
            spread = math.sqrt(0.5 / (1.0 + _RICIAN))
            wave = steady + spread * complex(rng.standard_normal(), rng.standard_normal())
            return enr_db + 10.0 * math.log10(abs(wave) ** 2)

        return fading


def group_found(pulses: Sequence[Pulse], truth: Sequence[TruePulse], tag: Tag) -> bool:
    """True if one of the reported groups is the tag's.

    All its frequencies must be within 50 Hz, and at least half of its pulses in place.
    """
    groups: dict[tuple[int, int], list[Pulse]] = {}
    for pulse in pulses:
        groups.setdefault((pulse.rate, pulse.group_sequence), []).append(pulse)
    for group in groups.values():
        comparison = compare(group, truth, tag)
        if comparison.matched * 2 >= len(group) and all(
            abs(p.frequency_hz - tag.frequency_hz - truth[0].offset_hz) <= 50.0 for p in group
        ):
            return True
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A long stretch with a tag, optionally with other signals, compared with the truth."""

    enr_db: float | Callable[[float], float]
    tag: Tag = THESIS_TAG
    duration_s: float = 300.0
    interval_error_s: float | None = None
    """Error of the interval [s]; None: random within ± 50 ms."""
    jitter_s: float = 0.005
    offset_hz: float = 333.0
    first_s: float | None = None
    drift_hz_per_s: float = 0.0
    interval_drift: float = 0.0
    frequency_window_hz: float = WHOLE_CHANNEL_HZ
    extra: Callable[[np.random.Generator, int], Samples] | None = None
    """Makes additional samples, such as interference or other tags; None: none."""

    def samples(self, rng: np.random.Generator) -> tuple[Samples, list[TruePulse]]:
        """Make the samples and the truth."""
        error = (
            rng.uniform(-0.05, 0.05) if self.interval_error_s is None else self.interval_error_s
        )
        truth = pulse_train(
            rng,
            duration_s=self.duration_s,
            interval_s=self.tag.pulse_intervals_s[0] + error,
            offset_hz=self.offset_hz,
            enr_db=self.enr_db,
            jitter_s=self.jitter_s,
            first_s=self.first_s,
            drift_hz_per_s=self.drift_hz_per_s,
            interval_drift=self.interval_drift,
            width_s=self.tag.pulse_width_s,
        )
        samples = make_samples(
            rng, truth, duration_s=self.duration_s, width_s=self.tag.pulse_width_s
        )
        if self.extra is not None:
            samples += self.extra(rng, len(samples))
        return samples, truth

    def fly(self, rng: np.random.Generator) -> Comparison:
        """Run a detector and compare its reports with the truth."""
        samples, truth = self.samples(rng)
        pulses, _ = detect(samples, self.tag, frequency_window_hz=self.frequency_window_hz)
        return compare(pulses, truth, self.tag)
