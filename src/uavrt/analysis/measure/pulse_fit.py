"""Fit one pulse: start, end and frequency of a rectangular burst of a carrier in noise.

A carrier of frequency f is assumed to be on from sample a to sample b. Its log likelihood
ratio, maximised over amplitude and phase, is ``|C[b] - C[a]|² / (b - a)`` divided by the noise
power. C is the cumulative sum of the samples after a frequency shift by -f. All pairs (a, b)
are tried at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

COARSE: Final = 4
"""Step of the first search for a pulse's edges [samples]."""
SMOOTH_S: Final = 0.002
"""Length of the Hann window that removes signals more than 1 kHz off [s]; it does not shift the
pulse's edges."""
IMPULSE_S: Final = 0.0013
IMPULSE_RATIO: Final = 30.0
"""Power ratio of a sample to the median on both sides that makes it an impulse.

Noise reaches it once in a million samples. At a pulse's edge, one side is as strong as the
sample."""
MOST_CARRIERS: Final = 4
CARRIER_RATIO: Final = 30.0
"""Minimum ratio of a steady carrier's peak in the spectrum to the spectrum's median."""
SHORTEST_S: Final = 0.004
LONGEST_S: Final = 0.080
TURNS: Final = 3
"""Number of iterations in which a pulse's frequency and edges are refined alternately."""
SLOPES_HZ_S: Final = np.arange(-30e3, 30.1e3, 2.5e3)
"""Slopes of the frequency that are tried [Hz/s]: up to 600 Hz in a pulse of 20 ms."""
SLIDING_GAIN: Final = 1.3
"""Minimum gain of pulse energy by a slope for it to be the tag's; a slide of 140 Hz within a
pulse has it."""
MOST_TRIED: Final = 60
"""Number of pulses of a tag from which its slope is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedPulse:
    """Measured edges, frequency and energy of one pulse."""

    start_s: float
    """Start of the pulse, relative to the first given sample [s]."""
    width_s: float
    frequency_hz: float
    """Frequency of the pulse relative to the centre of the samples' band [Hz]."""
    energy: float
    """Energy of the pulse: squared amplitude times width in samples [sample units²]."""


def fit_pulse(
    samples: NDArray[np.complex64], *, sample_rate_hz: float, frequency_hz: float
) -> FittedPulse:
    """Fit the strongest pulse in the samples' middle half; the rest must be noise."""
    shortest = max(2, round(SHORTEST_S * sample_rate_hz))
    longest = min(samples.size, round(LONGEST_S * sample_rate_hz))
    samples = without_carriers(without_impulses(samples, sample_rate_hz))
    first, last = 0, samples.size
    running = np.zeros(1, np.complex128)
    for turn in range(TURNS):
        turned = samples * _turned(samples.size, frequency_hz / sample_rate_hz)
        running = np.concatenate(([0.0], np.cumsum(_smooth(turned, sample_rate_hz))))
        if turn < TURNS - 1:
            first, last = _edges(running[::COARSE], shortest // COARSE, longest // COARSE)
            first, last = COARSE * first, COARSE * last
        first, last = _better_edges(running, first, last, shortest)
        frequency_hz = _frequency(samples[first:last], sample_rate_hz, frequency_hz)
    begin, end = _between(running, first, last)
    turned = samples[first:last] * _turned(last - first, frequency_hz / sample_rate_hz)
    return FittedPulse(
        start_s=begin / sample_rate_hz,
        width_s=(end - begin) / sample_rate_hz,
        frequency_hz=frequency_hz,
        energy=float(abs(turned.sum()) ** 2 / (last - first)),
    )


def slide_of(pulses: Sequence[NDArray[np.complex64]], sample_rate_hz: float) -> float:
    """Common slope of the frequency within pulses [Hz/s]; 0 if a constant frequency fits.

    Each pulse is in the middle half of its samples. With the opposite slope, a pulse is a line
    of its spectrum, wherever it begins.
    """
    energies = []
    for samples in pulses[:MOST_TRIED]:
        middle = without_impulses(samples, sample_rate_hz)
        middle = middle[len(middle) // 4 : len(middle) - len(middle) // 4]
        from_middle_s = seconds_from_middle(len(middle), sample_rate_hz)
        still = middle * np.exp(-1j * np.pi * SLOPES_HZ_S[:, np.newaxis] * from_middle_s**2)
        spectrum = scipy.fft.fft(still, 2 * len(middle))
        energies.append((spectrum.real**2 + spectrum.imag**2).max(axis=1))
    typical = np.median(energies, axis=0)
    best = int(typical[1:-1].argmax()) + 1
    if typical[best] < SLIDING_GAIN * typical[len(typical) // 2]:
        return 0.0
    below, here, above = np.log(typical[best - 1 : best + 2]).tolist()
    shift = 0.5 * (below - above) / min(below - 2.0 * here + above, -1e-9)
    step_hz_s = SLOPES_HZ_S[1] - SLOPES_HZ_S[0]
    return float(SLOPES_HZ_S[best] + step_hz_s * min(max(shift, -0.5), 0.5))


def seconds_from_middle(count: int, sample_rate_hz: float) -> NDArray[np.float64]:
    """Times of samples relative to the middle of all [s]."""
    return np.asarray(np.arange(count) - 0.5 * (count - 1), np.float64) / sample_rate_hz


def strongest_hz(samples: NDArray[np.complex128], sample_rate_hz: float) -> float:
    """Frequency of the strongest line in the middle half of the samples [Hz]."""
    middle = samples[len(samples) // 4 : len(samples) - len(samples) // 4]
    place = int(np.abs(scipy.fft.fft(middle, 2 * len(middle))).argmax())
    return float(scipy.fft.fftfreq(2 * len(middle), 1.0 / sample_rate_hz)[place])


def without_impulses(
    samples: NDArray[np.complex64], sample_rate_hz: float
) -> NDArray[np.complex64]:
    """Set single samples to zero that are far stronger than the samples on both sides."""
    side = max(4, round(IMPULSE_S * sample_rate_hz))
    power = samples.real**2 + samples.imag**2
    padded = np.pad(power, side, mode="edge")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, side), axis=1)
    # A gap of two samples on either side: a filtered impulse is a few samples wide.
    gap = max(1, round(0.0003 * sample_rate_hz))
    place = np.arange(samples.size)
    before = medians[np.maximum(place - gap, 0)]
    after = medians[np.minimum(place + side + 1 + gap, medians.size - 1)]
    hit = power > IMPULSE_RATIO * np.maximum(before, after)
    wide = np.convolve(hit, np.ones(2 * gap + 1), mode="same") > 0.5
    return np.where(wide, np.complex64(0.0), samples)


def without_carriers(samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
    """Subtract steady carriers, each the peak of the remaining spectrum, fitted by least
    squares to the outer quarters of the samples, without the pulse in the middle half.
    """
    count = samples.size
    outer = np.ones(count)
    outer[count // 4 : count - count // 4] = 0.0
    left = samples.astype(np.complex128)
    size = int(scipy.fft.next_fast_len(8 * count))
    for _ in range(MOST_CARRIERS):
        power = np.abs(scipy.fft.fft(left * outer, size)) ** 2
        peak = int(np.argmax(power))
        if power[peak] < CARRIER_RATIO * np.median(power):
            break
        below, here, above = power[peak - 1], power[peak], power[(peak + 1) % size]
        bend = below - 2.0 * here + above
        shift = 0.5 * (below - above) / bend if bend < 0.0 else 0.0
        line = np.exp(2j * np.pi * (peak + shift) / size * np.arange(count))
        left = left - line * ((left * np.conj(line) * outer).sum() / outer.sum())
    return left.astype(np.complex64)


def _smooth(samples: NDArray[np.complex128], sample_rate_hz: float) -> NDArray[np.complex128]:
    window = np.hanning((round(SMOOTH_S * sample_rate_hz) | 1) + 2)[1:-1]
    return np.asarray(np.convolve(samples, window / window.sum(), mode="same"))


def _turned(count: int, cycles: float) -> NDArray[np.complex128]:
    return np.asarray(np.exp(-2j * np.pi * cycles * np.arange(count)), dtype=np.complex128)


def _edges(running: NDArray[np.complex128], shortest: int, longest: int) -> tuple[int, int]:
    """Pair of samples between which pulse energy divided by length is greatest."""
    best, edges = -1.0, (0, shortest)
    for length in range(shortest, longest + 1):
        gathered = running[length:] - running[:-length]
        score = (gathered.real**2 + gathered.imag**2) / length
        at = int(np.argmax(score))
        if score[at] > best:
            best, edges = float(score[at]), (at, at + length)
    return edges


def _better_edges(
    running: NDArray[np.complex128], first: int, last: int, shortest: int
) -> tuple[int, int]:
    """Shift a pulse's edges by up to two coarse steps, to the greatest likelihood."""
    reach = np.arange(-2 * COARSE, 2 * COARSE + 1)
    starts = np.clip(first + reach, 0, running.size - 1)
    ends = np.clip(last + reach, 0, running.size - 1)
    length = ends[None, :] - starts[:, None]
    gathered = running[ends][None, :] - running[starts][:, None]
    score = np.where(length >= shortest, np.abs(gathered) ** 2 / np.maximum(length, 1), -1.0)
    row, column = np.unravel_index(int(np.argmax(score)), score.shape)
    if score[row, column] < 0.0:
        return first, last
    return int(starts[row]), int(ends[column])


def _frequency(pulse: NDArray[np.complex64], rate_hz: float, near_hz: float) -> float:
    size = int(scipy.fft.next_fast_len(16 * pulse.size))
    power = np.abs(scipy.fft.fft(pulse, size)) ** 2
    frequencies = scipy.fft.fftfreq(size, 1.0 / rate_hz)
    # Within two widths of the line: never to another transmitter.
    power[np.abs(frequencies - near_hz) > 2.0 * rate_hz / pulse.size] = 0.0
    peak = int(np.argmax(power))
    below, here, above = power[peak - 1], power[peak], power[(peak + 1) % size]
    bend = below - 2.0 * here + above
    shift = 0.5 * (below - above) / bend if bend < 0.0 else 0.0
    return float(frequencies[peak] + np.clip(shift, -0.5, 0.5) * rate_hz / size)


def _between(running: NDArray[np.complex128], first: int, last: int) -> tuple[float, float]:
    """Interpolate both edges to a fraction of a sample, by the amplitudes there.

    A sample at the edge of a pulse has the share of the amplitude that the pulse covers. Each
    edge is shifted until the summed amplitude agrees with that inside the pulse.
    """
    length = last - first
    inset = max(1, length // 8)
    inside = running[last - inset] - running[first + inset]
    amplitude = inside / (length - 2 * inset)
    if amplitude == 0.0:
        return float(first), float(last)
    reach = min(3, first, running.size - 1 - last)
    phase = np.conj(amplitude) / abs(amplitude) ** 2
    before = float(((running[first + inset] - running[first - reach]) * phase).real)
    after = float(((running[last + reach] - running[last - inset]) * phase).real)
    return first + inset - before, last - inset + after
