"""Random bursts of other transmitters in the channel: hoppers, slots of a frame, speech.

Levels are the ENR of a burst with the length of the tag's pulse at its own frequency [dB].
"""

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.complex64]
Scene = Callable[[np.random.Generator, int], Samples]
"""Makes a number of samples of the transmitters, without noise."""
LEVELS_DB = (20.0, 35.0)
_PULSE_S = 0.020
_EDGE_S = 0.5e-3
_PITCH_HZ = (90.0, 220.0)
_HARMONICS = 12


def add_burst(
    samples: Samples,
    *,
    start_s: float,
    length_s: float,
    offset_hz: float,
    level_db: float,
    phase: float,
    sample_rate_hz: float = 3750.0,
) -> None:
    """Add a burst of one frequency in place, with edges of half a millisecond."""
    first = max(0, math.ceil(start_s * sample_rate_hz))
    last = min(len(samples), math.ceil((start_s + length_s) * sample_rate_hz))
    if last <= first:
        return
    t = np.arange(first, last) / sample_rate_hz
    edge = np.clip(np.minimum(t - start_s, start_s + length_s - t) / _EDGE_S, 0.0, 1.0)
    amplitude = math.sqrt(10.0 ** (level_db / 10.0) / (_PULSE_S * sample_rate_hz))
    wave = amplitude * edge * np.exp(1j * (2.0 * np.pi * offset_hz * t + phase))
    samples[first:last] += wave.astype(np.complex64)


@dataclass(frozen=True, slots=True)
class Hopper:
    """Bursts at random times and frequencies.

    `per_s`: mean number in a second in the whole channel.
    `dwell_s`: shortest and longest duration of a burst [s].
    """

    per_s: float
    _: KW_ONLY
    dwell_s: tuple[float, float] = (0.010, 0.025)
    levels_db: tuple[float, float] = LEVELS_DB

    def __call__(
        self, rng: np.random.Generator, count: int, sample_rate_hz: float = 3750.0
    ) -> Samples:
        """Samples of the hopper's signal."""
        samples = np.zeros(count, np.complex64)
        duration_s = count / sample_rate_hz
        for start_s in rng.uniform(0.0, duration_s, rng.poisson(self.per_s * duration_s)):
            add_burst(
                samples,
                start_s=start_s,
                length_s=rng.uniform(*self.dwell_s),
                offset_hz=rng.uniform(-0.5, 0.5) * sample_rate_hz,
                level_db=rng.uniform(*self.levels_db),
                phase=rng.uniform(0.0, 2.0 * math.pi),
                sample_rate_hz=sample_rate_hz,
            )
        return samples


@dataclass(frozen=True, slots=True)
class Slots:
    """Slots of a frame on one frequency, each used or not at random.

    `frame_s`: time from a slot to the next of the same user [s].
    `slot_s`: length of a burst [s].
    `busy`: share of the frames in which the slot is used.
    `users`: number of users, with slots at different places of the frame, and their own levels
    and frequencies (± 20 Hz).
    """

    frame_s: float
    _: KW_ONLY
    slot_s: float
    busy: float
    offset_hz: float = 120.0
    users: int = 1
    levels_db: tuple[float, float] = LEVELS_DB

    def __call__(
        self, rng: np.random.Generator, count: int, sample_rate_hz: float = 3750.0
    ) -> Samples:
        """Samples of the users' signals."""
        samples = np.zeros(count, np.complex64)
        duration_s = count / sample_rate_hz
        for _ in range(self.users):
            first_s = rng.uniform(0.0, self.frame_s)
            level_db = rng.uniform(*self.levels_db)
            offset_hz = self.offset_hz + rng.uniform(-20.0, 20.0)
            starts_s = np.arange(first_s, duration_s, self.frame_s)
            for start_s in starts_s[rng.uniform(size=len(starts_s)) < self.busy]:
                add_burst(
                    samples,
                    start_s=float(start_s),
                    length_s=self.slot_s,
                    offset_hz=offset_hz,
                    level_db=level_db + rng.normal(0.0, 1.0),
                    phase=rng.uniform(0.0, 2.0 * math.pi),
                    sample_rate_hz=sample_rate_hz,
                )
        return samples


@dataclass(frozen=True, slots=True)
class Voice:
    """Speech of one sideband: syllables of harmonics of a gliding pitch, in overs (spells of
    speech).

    `per_s`: syllables in a second of an over.
    `over_s`, `pause_s`: mean lengths of an over and of the silence after it [s].
    `syllable_s`: shortest and longest syllable [s].
    `lowest_hz`: frequency of the speech's zero relative to the channel's centre [Hz].
    """

    per_s: float
    _: KW_ONLY
    over_s: float = 4.0
    pause_s: float = 4.0
    syllable_s: tuple[float, float] = (0.020, 0.120)
    lowest_hz: float = -900.0
    levels_db: tuple[float, float] = LEVELS_DB

    def __call__(
        self, rng: np.random.Generator, count: int, sample_rate_hz: float = 3750.0
    ) -> Samples:
        """Samples of the speech's signal."""
        samples = np.zeros(count, np.complex64)
        duration_s = count / sample_rate_hz
        at = float(rng.exponential(self.pause_s))
        while at < duration_s:
            until = at + float(rng.exponential(self.over_s))
            while at < min(until, duration_s):
                length_s = rng.uniform(*self.syllable_s)
                self._speak(rng, samples, at, length_s, sample_rate_hz)
                at += length_s + float(rng.exponential(1.0 / self.per_s))
            at += float(rng.exponential(self.pause_s))
        return samples

    def _speak(
        self,
        rng: np.random.Generator,
        samples: Samples,
        start_s: float,
        length_s: float,
        sample_rate_hz: float,
    ) -> None:
        first = math.ceil(start_s * sample_rate_hz)
        last = min(len(samples), math.ceil((start_s + length_s) * sample_rate_hz))
        if last <= first:
            return
        t = np.arange(last - first) / sample_rate_hz
        pitch_hz, glide = rng.uniform(*_PITCH_HZ), rng.normal(0.0, 60.0)
        formant_hz, level_db = rng.uniform(300.0, 1500.0), rng.uniform(*self.levels_db)
        envelope = np.sin(np.pi * np.clip(t / length_s, 0.0, 1.0)) ** 0.5
        wave = np.zeros(len(t), np.complex128)
        for harmonic in range(1, _HARMONICS + 1):
            away = (harmonic * pitch_hz - formant_hz) / 400.0
            amplitude = 10.0 ** ((level_db - 6.0 * away * away) / 20.0)
            turn = harmonic * (pitch_hz * t + 0.5 * glide * t * t) + self.lowest_hz * t
            wave += amplitude * np.exp(1j * (2.0 * np.pi * turn + rng.uniform(0.0, 6.28)))
        scale = 1.0 / math.sqrt(_PULSE_S * sample_rate_hz)
        samples[first:last] += (scale * envelope * wave).astype(np.complex64)
