"""Interference: carriers, impulses, coloured noise."""

import math

import numpy as np
from numpy.typing import NDArray


def carrier(
    rng: np.random.Generator,
    count: int,
    *,
    offset_hz: float,
    level_db: float,
    sample_rate_hz: float = 3750.0,
    drift_hz_per_s: float = 0.0,
    modulation: float = 0.0,
    modulation_hz: float = 1.3,
    bin_s: float = 0.02,
) -> NDArray[np.complex64]:
    """Samples of a continuous carrier, shape (count,).

    `count`: number of samples.
    `offset_hz`: frequency relative to the channel's centre, at the start [Hz].
    `level_db`: power over the noise in one bin of `bin_s`, as in the spectrogram [dB].
    `modulation`, `modulation_hz`: depth and frequency [Hz] of an amplitude modulation.
    """
    t = np.arange(count) / sample_rate_hz
    amplitude = math.sqrt(10.0 ** (level_db / 10.0) / (bin_s * sample_rate_hz))
    phase = 2.0 * np.pi * (offset_hz * t + 0.5 * drift_hz_per_s * t * t)
    wave = np.exp(1j * (phase + rng.uniform(0.0, 2.0 * np.pi)))
    wave *= amplitude * (1.0 + modulation * np.sin(2.0 * np.pi * modulation_hz * t))
    return np.asarray(wave, np.complex64)


def impulses(
    rng: np.random.Generator,
    count: int,
    *,
    per_s: float,
    level_db: float,
    length_s: float = 1e-3,
    sample_rate_hz: float = 3750.0,
    regular: bool = False,
) -> NDArray[np.complex64]:
    """Samples of bursts of wideband noise, shape (count,).

    `per_s`: mean number in a second.
    `level_db`: power of a sample of a burst over the noise power of a sample [dB].
    `regular`: evenly spaced, as a serial port makes them, instead of at random.
    """
    wave = np.zeros(count, np.complex64)
    length = max(1, round(length_s * sample_rate_hz))
    duration = count / sample_rate_hz
    if regular:
        starts = np.arange(rng.uniform(0.0, 1.0 / per_s), duration, 1.0 / per_s)
    else:
        starts = rng.uniform(0.0, duration, rng.poisson(per_s * duration))
    scale = math.sqrt(0.5 * 10.0 ** (level_db / 10.0))
    for start in (starts * sample_rate_hz).astype(int):
        stop = min(start + length, count)
        burst = rng.standard_normal((stop - start, 2)) @ np.array([1.0, 1j])
        wave[start:stop] += (scale * burst).astype(np.complex64)
    return wave


def coloured_noise(
    rng: np.random.Generator,
    count: int,
    *,
    tilt_db: float = 0.0,
    edge: bool = False,
    hum: bool = False,
    sample_rate_hz: float = 3750.0,
) -> NDArray[np.complex64]:
    """Noise of about unit power with a shaped spectrum, shape (count,).

    `tilt_db`: difference of the density between the channel's two edges [dB].
    `edge`: fall by 40 dB from 1600 Hz to the edge, as behind a channelizer.
    `hum`: noise lines 1.5 Hz wide at multiples of 100 Hz, 12 dB in a bin.
    """
    spectrum = rng.standard_normal((count, 2)) @ np.array([1.0, 1j]) * math.sqrt(0.5)
    frequency = np.fft.fftfreq(count, 1.0 / sample_rate_hz)
    level_db = tilt_db * frequency / sample_rate_hz
    if edge:
        nyquist = sample_rate_hz / 2.0
        start = 0.85 * nyquist
        level_db -= 40.0 * np.clip((np.abs(frequency) - start) / (nyquist - start), 0.0, 1.0)
    density = 10.0 ** (level_db / 10.0)
    if hum:
        lines = np.abs((frequency + 50.0) % 100.0 - 50.0) < 0.75
        density = density + lines * (10.0**1.2 * 50.0 / 1.5)
    shaped = spectrum * np.sqrt(density)
    return np.asarray(np.fft.ifft(shaped) * math.sqrt(count), np.complex64)
