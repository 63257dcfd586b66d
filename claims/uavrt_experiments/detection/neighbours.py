"""Noise that is not white: a neighbour with an edge near the tag, and sparks of the mains."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt_experiments.detection.signals import noise

Samples = NDArray[np.complex64]
_SLOPE_HZ = 100.0
"""Width of a neighbour's edge [Hz], within which a transmitter's filter falls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbour:
    """A transmitter with a noise-like signal: digital voice or data.

    `edge_hz`: frequency at which it begins, relative to the channel's centre; it fills the
    channel from there to the upper border.
    `level_db`: its density over that of the noise.
    `on_s`, `off_s`: mean lengths of its transmissions and pauses; without pauses it is steady.
    `clicks`: True if it is keyed behind its filter, with ramps of 2.4 ms that spread beyond its
    band.
    """

    edge_hz: float
    level_db: float
    on_s: float = 1.0
    off_s: float = 0.0
    clicks: bool = False
    sample_rate_hz: float = 3750.0

    def __call__(self, rng: np.random.Generator, count: int) -> Samples:
        """The neighbour's signal without the noise of the receiver, shape (count,)."""
        keyed = self.off_s > 0.0
        wave = noise(rng, count)
        if keyed and not self.clicks:
            wave *= _keying(rng, count, self.on_s, self.off_s, self.sample_rate_hz)
        spectrum = np.fft.fft(wave)
        frequency_hz = np.fft.fftfreq(count, 1.0 / self.sample_rate_hz)
        inside = np.clip((frequency_hz - self.edge_hz) / _SLOPE_HZ + 0.5, 0.0, 1.0)
        inside *= np.clip((self.sample_rate_hz / 2.0 - frequency_hz) / _SLOPE_HZ, 0.0, 1.0)
        shaped = np.fft.ifft(spectrum * np.sin(0.5 * np.pi * inside))
        shaped *= math.pow(10.0, self.level_db / 20.0)
        if keyed and self.clicks:
            shaped *= _keying(rng, count, self.on_s, self.off_s, self.sample_rate_hz)
        return np.asarray(shaped, np.complex64)


def _keying(
    rng: np.random.Generator, count: int, on_s: float, off_s: float, rate_hz: float
) -> NDArray[np.float32]:
    """One while a transmitter sends, zero in its pauses, whose lengths differ by half; shape
    (count,).
    """
    on = np.zeros(count)
    at = -rng.uniform(0.0, on_s + off_s) * rate_hz
    while at < count:
        length = rng.uniform(0.5, 1.5) * on_s * rate_hz
        on[max(0, round(at)) : max(0, round(at + length))] = 1.0
        at += length + rng.uniform(0.5, 1.5) * off_s * rate_hz
    ramp = np.hanning(9)
    return np.asarray(np.convolve(on, ramp / ramp.sum(), "same").astype(np.float32))


@dataclass(frozen=True, slots=True, kw_only=True)
class MainsSparks:
    """Noise of a power line, which sparks at twice the mains frequency.

    `per_s`: sparks in a second, 100 or 120.
    `duty`: share of the time with a spark.
    `level_db`: mean density over that of the noise [dB].
    `varying`: true if the strength differs from spark to spark.
    """

    per_s: float
    duty: float
    level_db: float
    varying: bool = False
    sample_rate_hz: float = 3750.0

    def __call__(self, rng: np.random.Generator, count: int) -> Samples:
        """The power line's noise without that of the receiver, shape (count,)."""
        cycles = np.arange(count) * (self.per_s / self.sample_rate_hz)
        # The mains frequency wanders.
        cycles += np.cumsum(rng.standard_normal(count)) * 1e-3 + rng.uniform()
        power = (cycles % 1.0 < self.duty) / self.duty
        if self.varying:
            spark = np.maximum(cycles.astype(np.int64) + 9, 0)
            power = power * rng.gamma(1.5, 1.0 / 1.5, int(spark.max()) + 1)[spark]
        wave = np.sqrt(power) * noise(rng, count) * math.pow(10.0, self.level_db / 20.0)
        return np.asarray(wave, np.complex64)


Noise = Callable[[np.random.Generator, int], Samples]


def over_noise(make: Noise) -> Noise:
    """Add the noise of the receiver to a signal."""

    def both(rng: np.random.Generator, count: int) -> Samples:
        return noise(rng, count) + make(rng, count)

    return both


def neighbours() -> Iterator[tuple[str, Neighbour]]:
    """All kinds of neighbour, with names."""
    for edge_hz in (300.0, 600.0, 1000.0, 1500.0):
        for level_db in (10.0, 20.0, 30.0, 40.0, 60.0):
            name = f"edge {edge_hz:.0f} Hz, {level_db:.0f} dB"
            yield f"{name}, steady", Neighbour(edge_hz=edge_hz, level_db=level_db)
            for on_s, off_s in ((0.03, 0.03), (0.5, 0.5), (3.0, 3.0)):
                yield (
                    f"{name}, keyed {on_s:g} s",
                    Neighbour(edge_hz=edge_hz, level_db=level_db, on_s=on_s, off_s=off_s),
                )


def sparks() -> Iterator[tuple[str, MainsSparks]]:
    """All kinds of sparks, with names."""
    for per_s in (100.0, 120.0):
        for duty in (0.05, 0.15, 0.3, 0.5):
            for level_db in (3.0, 6.0, 12.0, 20.0):
                for varying in (False, True):
                    name = f"{per_s:.0f} per s, duty {100 * duty:.0f} %, {level_db:.0f} dB"
                    yield (
                        name + (", varying" if varying else ""),
                        MainsSparks(per_s=per_s, duty=duty, level_db=level_db, varying=varying),
                    )
