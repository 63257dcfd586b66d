"""A flight past a weak tag, made without the project's simulator, patterns or experiments.

A drone holds its place in gusts and turns unevenly with a beam antenna. The tag's pulses rise
and decay, its frequency settles within each pulse and drifts, and its timer is warming up.
"""

from dataclasses import dataclass

import numpy as np
from foreign_bursts import KeyedStage, add_pulse, white_noise
from numpy.typing import NDArray

Floats = NDArray[np.float64]
COLLAR = KeyedStage(rise_s=4e-4, decay_s=6e-4, chirp_hz=30.0, settling_s=1.5e-3)
FADING_DB = 0.5
"""Standard deviation of a pulse's level, from the animal's movements."""


@dataclass(frozen=True, kw_only=True)
class ForeignFlight:
    """Path and heading every fifth of a second, and the channel's samples."""

    time_s: Floats
    east_m: Floats
    north_m: Floats
    yaw_deg: Floats
    samples: NDArray[np.complex64]


def beam_db(away_deg: Floats) -> Floats:
    """Gain of the beam this far from its boresight: 3 dB less at 40°, a back lobe of -11 dB."""
    half = np.radians(away_deg) / 2.0
    front, back = np.abs(np.cos(half)) ** 5.6, 0.28 * np.abs(np.sin(half)) ** 8
    return np.asarray(10.0 * np.log10(front**2 + back**2 + 0.008))


def fly(
    rng: np.random.Generator,
    *,
    strongest_db: float,
    pulses: int,
    interval_s: float,
    jitter_s: float,
    offset_hz: float,
    rate_hz: float,
) -> ForeignFlight:
    """Fly once; `strongest_db` is the ENR of a pulse of mean level in the beam's middle."""
    time_s = np.arange(0.0, pulses * interval_s + 0.2, 0.2)
    gusts = rng.normal(0.0, 1.0, (2, len(time_s)))
    place_m = 0.3 * np.array([_smoothed(one, 40) for one in gusts]) * np.sqrt(40.0)
    rate_deg_s = (
        6.0
        + 1.2 * np.sin(time_s / 23.0)
        + 1.5 * _smoothed(rng.normal(0.0, 3.0, len(time_s)), 15)
    )
    yaw_deg = rng.uniform(0.0, 360.0) + np.cumsum(rate_deg_s) * 0.2
    azimuth = rng.uniform(0.0, 2.0 * np.pi)
    range_m = rng.uniform(1200.0, 3500.0)
    toward = np.degrees(
        np.arctan2(
            range_m * np.sin(azimuth) - place_m[0], range_m * np.cos(azimuth) - place_m[1]
        )
    )
    away_deg = (yaw_deg - toward + 180.0) % 360.0 - 180.0
    samples = white_noise(rng, time_s[-1], rate_hz)
    slow_hz = rng.uniform(-8.0, 8.0)
    warming = rng.uniform(-15e-6, 15e-6)
    at_s = rng.uniform(0.0, interval_s)
    while at_s + 0.06 < time_s[-1]:
        passed = at_s / time_s[-1]
        level_db = float(np.interp(at_s, time_s, beam_db(away_deg)) - beam_db(np.zeros(1))[0])
        add_pulse(
            samples,
            COLLAR,
            at_s + float(np.clip(rng.normal(0.0, jitter_s / 2.0), -jitter_s, jitter_s)),
            0.02,
            offset_hz + slow_hz * passed,
            strongest_db + level_db + rng.normal(0.0, FADING_DB),
            rng.uniform(-np.pi, np.pi),
            rate_hz,
        )
        at_s += interval_s * (1.0 + warming * (1.0 - np.exp(-4.0 * passed)))
    return ForeignFlight(
        time_s=time_s,
        east_m=place_m[0],
        north_m=place_m[1],
        yaw_deg=yaw_deg,
        samples=samples,
    )


def _smoothed(values: Floats, count: int) -> Floats:
    return np.convolve(values, np.ones(count) / count, mode="same")
