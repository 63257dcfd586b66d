"""Bursts of coded tags, made without the project's simulator or experiments.

A transmitter's keyed stage: its amplitude rises and decays exponentially, its frequency settles
within each pulse and drifts from burst to burst, its timer has jitter and an error of its own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RISE_S, DECAY_S = 1.0e-4, 1.5e-4
CHIRP_HZ, SETTLING_S = 40.0, 8e-4
GAP_JITTER_S, INTERVAL_JITTER_S = 3e-5, 1e-4
DRIFT_HZ_PER_S = 0.5


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
            _key(
                samples,
                at_s + rng.normal(0.0, GAP_JITTER_S),
                key_s,
                carrier_hz,
                enr_db,
                rng.uniform(-np.pi, np.pi),
                rate_hz,
            )
    return begins


def _key(
    samples: NDArray[np.complex64],
    at_s: float,
    key_s: float,
    carrier_hz: float,
    enr_db: float,
    phase: float,
    rate_hz: float,
) -> None:
    first = int(np.floor(at_s * rate_hz))
    index = np.arange(first, first + int((key_s + 8.0 * DECAY_S) * rate_hz) + 2)
    t_s = index / rate_hz - at_s
    on = 1.0 - np.exp(-np.maximum(t_s, 0.0) / RISE_S)
    off = np.exp(-np.maximum(t_s - key_s, 0.0) / DECAY_S)
    envelope = np.where(t_s > 0.0, on * off, 0.0)
    settled = np.where(t_s > 0.0, SETTLING_S * (1.0 - np.exp(-t_s.clip(0.0) / SETTLING_S)), 0.0)
    turns = carrier_hz * t_s + CHIRP_HZ * settled
    envelope *= np.sqrt(10.0 ** (enr_db / 10.0) / np.sum(envelope**2))
    samples[index] += (envelope * np.exp(1j * (2.0 * np.pi * turns + phase))).astype(
        np.complex64
    )
