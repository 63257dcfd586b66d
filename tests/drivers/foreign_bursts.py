"""Bursts of coded tags, made without the project's simulator or experiments.

A transmitter's keyed stage: its amplitude rises and decays exponentially, its frequency settles
within each pulse and drifts from burst to burst, its timer has jitter and an error of its own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GAP_JITTER_S, INTERVAL_JITTER_S = 3e-5, 1e-4
DRIFT_HZ_PER_S = 0.5


@dataclass(frozen=True, kw_only=True)
class KeyedStage:
    """How amplitude and frequency of a pulse begin and end."""

    rise_s: float
    decay_s: float
    chirp_hz: float
    """Excess of the frequency at the beginning of a pulse [Hz]."""
    settling_s: float


CODED = KeyedStage(rise_s=1.0e-4, decay_s=1.5e-4, chirp_hz=40.0, settling_s=8e-4)


@dataclass(frozen=True, kw_only=True)
class Transmitter:
    """One tag as it is built: its timer runs fast or slow by a part of its own."""

    gaps_s: tuple[float, ...]
    interval_s: float
    keys_s: tuple[float, ...] = (0.0025, 0.0025, 0.0025, 0.0025)
    """For how long each pulse is keyed."""
    offset_hz: float = 0.0
    timer_error: float = 0.0


def white_noise(
    rng: np.random.Generator, seconds: float, rate_hz: float
) -> NDArray[np.complex64]:
    """Noise of power 1 a sample, hence 1 / rate a hertz."""
    pairs = rng.normal(0.0, 0.5**0.5, (round(seconds * rate_hz), 2)).astype(np.float32)
    return np.ascontiguousarray(pairs).view(np.complex64)[:, 0]


def send(
    samples: NDArray[np.complex64],
    one: Transmitter,
    rng: np.random.Generator,
    *,
    first_s: float,
    bursts: int,
    enr_db: float,
    rate_hz: float,
) -> list[float]:
    """Add bursts in place; give the times at which they begin."""
    begins: list[float] = []
    for number in range(bursts):
        begin_s = first_s + number * one.interval_s * (1.0 + one.timer_error)
        begin_s += rng.normal(0.0, INTERVAL_JITTER_S)
        begins.append(begin_s)
        at_s = begin_s
        carrier_hz = one.offset_hz + DRIFT_HZ_PER_S * (begin_s - first_s)
        for gap_s, key_s in zip((0.0, *one.gaps_s), one.keys_s, strict=True):
            at_s += gap_s * (1.0 + one.timer_error)
            add_pulse(
                samples,
                CODED,
                at_s + rng.normal(0.0, GAP_JITTER_S),
                key_s,
                carrier_hz,
                enr_db,
                rng.uniform(-np.pi, np.pi),
                rate_hz,
            )
    return begins


def add_pulse(
    samples: NDArray[np.complex64],
    stage: KeyedStage,
    at_s: float,
    key_s: float,
    carrier_hz: float,
    enr_db: float,
    phase: float,
    rate_hz: float,
) -> None:
    """Add a pulse that is keyed for `key_s`, as far as it lies within the samples."""
    first = max(int(np.floor(at_s * rate_hz)), 0)
    last = first + int((key_s + 8.0 * stage.decay_s) * rate_hz) + 2
    index = np.arange(first, min(last, len(samples)))
    t_s = index / rate_hz - at_s
    since_s = t_s.clip(0.0)
    on = 1.0 - np.exp(-since_s / stage.rise_s)
    off = np.exp(-(t_s - key_s).clip(0.0) / stage.decay_s)
    envelope = np.where(t_s > 0.0, on * off, 0.0)
    settled = stage.settling_s * (1.0 - np.exp(-since_s / stage.settling_s))
    turns = carrier_hz * since_s + stage.chirp_hz * settled
    envelope *= np.sqrt(10.0 ** (enr_db / 10.0) / np.sum(envelope**2))
    samples[index] += (envelope * np.exp(1j * (2.0 * np.pi * turns + phase))).astype(
        np.complex64
    )
