"""Fit each pulse of a tag, and combine the fits to frequency, width and intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.measured_tag import MeasuredRate, MeasuredTag
from uavrt.analysis.measure.pulse_fit import (
    FittedPulse,
    fit_pulse,
    seconds_from_middle,
    slide_of,
    strongest_hz,
    without_carriers,
    without_impulses,
)
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.detection.beeps.beats import FoundBeat
from uavrt.detection.beeps.interval_fit import fit_beat
from uavrt.detection.beeps.tuning import INTERVALS

SAME_RATE: Final = 0.004
"""Largest relative difference between two measurements of the same pulse interval."""
NEAR_RATE: Final = 0.05
"""Largest relative difference of the intervals of two joined series of pulses."""
SIGNIFICANT: Final = 4.0
"""Smallest drift of the interval that is removed before the jitter is computed [standard
deviations]."""


@dataclass(frozen=True, slots=True, eq=False)
class PulseWindow:
    """Samples of a channel around one pulse."""

    samples: NDArray[np.complex64]
    time_ns: int
    sample_rate_hz: float
    offset_hz: float
    """Frequency of the tag relative to the channel's centre [Hz]."""
    apart_hz: float
    """Frequency of the pulse in the first pass, relative to the tag's frequency [Hz]."""
    burst: int


def measure_pulses(
    beats: Sequence[FoundBeat], windows: Sequence[PulseWindow], frequency_hz: float
) -> MeasuredTag:
    """Measure frequency, width and pulse intervals of a tag, with their standard deviations."""
    fits, slope_hz_s = _fits(windows)
    start_ns = windows[0].time_ns
    at_s = np.array(
        [(w.time_ns - start_ns) / NANOSECONDS_PER_SECOND for w in windows]
    ) + np.array([fit.start_s + fit.width_s / 2 for fit in fits])
    offset_hz = np.array(
        [fit.frequency_hz - w.offset_hz for fit, w in zip(fits, windows, strict=True)]
    )
    width_s = np.array([fit.width_s for fit in fits])
    good = _agree(width_s) & _agree(offset_hz)
    middle_s = (at_s[good].min() + at_s[good].max()) / 2
    offset, sigma_hz, slope, slope_sigma = _line(at_s[good] - middle_s, offset_hz[good])
    width, width_sigma_s = _middle(width_s[good])
    # Edges are found between samples, but no better than to a part of one.
    width_sigma_s = math.hypot(width_sigma_s, 0.3 / windows[0].sample_rate_hz)
    enr = [_enr(fit, window) for fit, window in zip(fits, windows, strict=True)]
    numbers = {window.burst: k for k, window in enumerate(windows)}
    return MeasuredTag(
        frequency_hz=frequency_hz + offset,
        frequency_sigma_hz=sigma_hz,
        drift_hz_per_s=slope,
        drift_sigma_hz_per_s=slope_sigma,
        pulse_width_s=width,
        pulse_width_sigma_s=width_sigma_s,
        slide_hz=slope_hz_s * width,
        enr_db=10.0 * math.log10(max(float(np.median(enr)), 1e-9)),
        pulses=int(good.sum()),
        rates=_rates(beats, numbers, at_s, good, start_ns),
    )


def _fits(windows: Sequence[PulseWindow]) -> tuple[list[FittedPulse], float]:
    """Fit each pulse; return also by how much the frequency slides within a pulse [Hz/s]."""
    slope_hz_s = slide_of([one.samples for one in windows], windows[0].sample_rate_hz)
    fits = []
    for one in windows:
        frequency_hz, samples = one.offset_hz + one.apart_hz, one.samples
        if not slope_hz_s:
            fits.append(
                fit_pulse(samples, sample_rate_hz=one.sample_rate_hz, frequency_hz=frequency_hz)
            )
            continue
        from_middle_s = seconds_from_middle(len(samples), one.sample_rate_hz)
        still = samples * np.exp(-1j * np.pi * slope_hz_s * from_middle_s**2)
        fit = fit_pulse(
            still.astype(np.complex64),
            sample_rate_hz=one.sample_rate_hz,
            frequency_hz=strongest_hz(still, one.sample_rate_hz),
        )
        middle_s = from_middle_s[0] + fit.start_s + 0.5 * fit.width_s
        fits.append(replace(fit, frequency_hz=fit.frequency_hz + slope_hz_s * middle_s))
    return fits, slope_hz_s


def _rates(
    beats: Sequence[FoundBeat],
    numbers: dict[int, int],
    at_s: NDArray[np.float64],
    good: NDArray[np.bool_],
    start_ns: int,
) -> tuple[MeasuredRate, ...]:
    """Compute intervals from pulse times, and merge series of pulses with equal ones."""
    stretches: list[tuple[NDArray[np.float64], float]] = []
    for beat in sorted(beats, key=lambda one: int(one.members[0])):
        chosen = [numbers[int(k)] for k in beat.members if int(k) in numbers]
        times_s = np.sort(at_s[[k for k in chosen if good[k]]])
        if times_s.size < INTERVALS.fewest_pulses - 1:
            continue
        interval_s = beat.beat.interval_s
        joined = None
        if stretches and abs(interval_s / stretches[-1][1] - 1.0) <= NEAR_RATE:
            joined = _continued(*stretches[-1], times_s)
        if joined is None:
            stretches.append((times_s, interval_s))
        else:
            stretches[-1] = joined, stretches[-1][1]
    measured = [_rate(times_s, interval_s, start_ns) for times_s, interval_s in stretches]
    rates: list[MeasuredRate] = []
    for rate in sorted(measured, key=lambda one: -one.pulses):
        for place, other in enumerate(rates):
            if abs(rate.interval_s / other.interval_s - 1.0) <= SAME_RATE:
                rates[place] = _joined(other, rate)
                break
        else:
            rates.append(rate)
    return tuple(sorted(rates, key=lambda one: -one.pulses))


def _continued(
    before_s: NDArray[np.float64], interval_s: float, after_s: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Join two series of pulse times across a gap; None unless both belong to one sequence of
    equal intervals.
    """
    together = np.concatenate((before_s, after_s))
    alone = fit_beat(before_s, interval_s)
    beat = fit_beat(together, alone.interval_s)
    same = abs(beat.interval_s / alone.interval_s - 1.0) <= SAME_RATE
    return together if same and beat.scatter_s <= 1.5 * alone.scatter_s + 0.001 else None


def _rate(times_s: NDArray[np.float64], interval_s: float, start_ns: int) -> MeasuredRate:
    beat = fit_beat(times_s, interval_s)
    number = beat.numbers - beat.numbers.mean()
    drift, drift_sigma, residuals = 0.0, math.inf, beat.residuals_s
    if times_s.size >= 6:
        fit = np.polynomial.polynomial.polyfit(number, times_s, 2)
        bent = times_s - np.polynomial.polynomial.polyval(number, fit)
        design = np.stack((np.ones_like(number), number, number**2), axis=1)
        variance = float((bent**2).sum()) / (times_s.size - 3)
        covariance = np.linalg.pinv(design.T @ design) * variance
        drift = float(2.0 * fit[2] / beat.interval_s)
        drift_sigma = float(2.0 * math.sqrt(covariance[2, 2]) / beat.interval_s)
        if abs(drift) > SIGNIFICANT * drift_sigma:
            residuals = bent
    return MeasuredRate(
        interval_s=beat.interval_s,
        interval_sigma_s=beat.sigma_s,
        jitter_s=float(np.sqrt((residuals**2).sum() / (times_s.size - 2))),
        largest_deviation_s=float(np.abs(residuals).max()),
        drift=drift,
        drift_sigma=drift_sigma,
        pulses=times_s.size,
        missing=int(beat.numbers[-1]) + 1 - times_s.size,
        first_time_ns=start_ns + ns_from_s(times_s[0]),
        last_time_ns=start_ns + round(times_s[-1] * NANOSECONDS_PER_SECOND),
    )


def _joined(first: MeasuredRate, second: MeasuredRate) -> MeasuredRate:
    weights = [1.0 / one.interval_sigma_s**2 for one in (first, second)]
    total = sum(weights)
    both = (first, second)
    pulses = first.pulses + second.pulses
    return MeasuredRate(
        interval_s=sum(w * one.interval_s for w, one in zip(weights, both, strict=True))
        / total,
        interval_sigma_s=math.sqrt(1.0 / total),
        jitter_s=math.sqrt(sum(one.pulses * one.jitter_s**2 for one in both) / pulses),
        largest_deviation_s=max(one.largest_deviation_s for one in both),
        drift=first.drift,
        drift_sigma=first.drift_sigma,
        pulses=pulses,
        missing=first.missing + second.missing,
        first_time_ns=min(one.first_time_ns for one in both),
        last_time_ns=max(one.last_time_ns for one in both),
    )


def _agree(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask that excludes outliers, such as a pulse that was disturbed by an impulse."""
    center = np.median(values)
    spread = 1.4826 * float(np.median(np.abs(values - center)))
    return np.asarray(np.abs(values - center) <= max(6.0 * spread, 0.1 * abs(center)))


def _middle(values: NDArray[np.float64]) -> tuple[float, float]:
    center = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - center)))
    return center, 1.2533 * spread / math.sqrt(values.size)


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Fit a line by least squares; return value at 0 and slope, each followed by its standard
    deviation.
    """
    design = np.stack((np.ones_like(x), x), axis=1)
    inverse = np.linalg.pinv(design.T @ design)
    value, slope = inverse @ design.T @ y
    spare = max(1, x.size - 2)
    variance = float(((y - design @ (value, slope)) ** 2).sum()) / spare
    return (
        float(value),
        math.sqrt(variance * inverse[0, 0]),
        float(slope),
        math.sqrt(variance * inverse[1, 1]),
    )


def _enr(fit: FittedPulse, window: PulseWindow) -> float:
    """Pulse's energy over the noise density before it, within 600 Hz of the pulse.

    The noise is the median of the spectrum, since a nearby carrier may fill some of its
    bins.
    """
    rate_hz = window.sample_rate_hz
    quiet = without_carriers(without_impulses(window.samples, rate_hz))
    quiet = quiet[: max(32, round((fit.start_s - 0.003) * rate_hz))]
    taper = np.hanning(quiet.size + 2)[1:-1]
    power = np.abs(np.fft.fft(quiet * taper)) ** 2 / (taper**2).sum()
    near = np.abs(np.fft.fftfreq(quiet.size, 1.0 / rate_hz) - fit.frequency_hz) <= 600.0
    noise = float(np.median(power[near])) / math.log(2.0)
    return fit.energy / noise if noise > 0.0 else math.inf
