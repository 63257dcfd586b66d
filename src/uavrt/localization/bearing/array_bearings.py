"""Estimate bearings from several antennas, compared by phase or by level within one pulse.

With a switch that changes the antenna at known samples, one receiver measures several antenna
elements during a 20 ms pulse, or the sum and difference of two elements. Comparing their
complex amplitudes with those of a wave from each direction is a matched-field estimate:
pseudo-Doppler (planned by VonEhr) or the two-point phased array (Cliff 2015). Comparing fixed
directional antennas by level alone is amplitude monopulse (Gottwald 2014).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bearing.pattern_likelihood import GRID_DEG
from uavrt.localization.bearing.posterior import described
from uavrt.localization.bearing.tuning import SIMPLE
from uavrt.localization.results import ArrayMethod, Bearing

_Floats = NDArray[np.float64]
_Complex = NDArray[np.complex128]

Steering = Callable[[_Floats], _Complex]
"""Function from directions (b,) clockwise from the nose [deg] to antenna outputs (b,
antennas)."""


def circle_steering(
    elements: int, radius_wavelengths: float, elevation_deg: float = 0.0
) -> Steering:
    """Return the steering function of monopoles spaced evenly on a circle, clockwise from ahead
    (pseudo-Doppler).

    If the radius exceeds a quarter wavelength, the phases of opposite elements may differ by
    more than half a cycle, and directions may become ambiguous.
    """
    places = np.arange(elements) * 360.0 / elements
    turns = radius_wavelengths * np.cos(np.radians(elevation_deg))

    def steering(direction_deg: _Floats) -> _Complex:
        angle = np.radians(direction_deg[:, None] - places[None, :])
        return np.asarray(np.exp(2j * np.pi * turns * np.cos(angle)))

    return steering


def pair_steering(
    spacing_wavelengths: float, elevation_deg: float = 0.0, *, modes: bool = True
) -> Steering:
    """Return the steering function of two adjacent elements or, with `modes`, of their sum and
    difference.
    """
    turns = spacing_wavelengths * np.cos(np.radians(elevation_deg))

    def steering(direction_deg: _Floats) -> _Complex:
        phase = np.pi * turns * np.sin(np.radians(direction_deg))
        if not modes:
            return np.stack([np.exp(-1j * phase), np.exp(1j * phase)], axis=1)
        return np.stack([2.0 * np.cos(phase) + 0j, 2j * np.sin(phase)], axis=1)

    return steering


def switched_bearing(
    amplitudes: _Complex,
    counts: _Floats,
    yaw_deg: _Floats,
    steering: Steering,
    *,
    noise_power: float | _Floats,
    method: ArrayMethod,
) -> Bearing:
    """Estimate a bearing from the amplitudes of one or several pulses.

    `amplitudes` (p, elements): complex amplitudes by `measure_switched_pulse`.
    `counts` (p, elements): number of samples averaged for each amplitude.
    `yaw_deg` (p,): heading of the array at each pulse, clockwise from true north.
    `steering`: `circle_steering` or `pair_steering`.
    `noise_power`: noise power of one sample, for all pulses or (p,).
    `method`: ``"pseudo_doppler"`` or ``"two_point_phased"``.
    """
    log_density = np.zeros(len(GRID_DEG))
    noises = np.broadcast_to(np.asarray(noise_power, np.float64), (len(yaw_deg),))
    for amplitude, count, yaw, noise in zip(amplitudes, counts, yaw_deg, noises, strict=True):
        weight = np.sqrt(count / noise)
        expected = steering(GRID_DEG - yaw) * weight
        # Strength and phase of the pulse are unknown, so only the projection counts.
        matched = np.abs(expected.conj() @ (amplitude * weight)) ** 2
        log_density += matched / np.sum(np.abs(expected) ** 2, axis=1)
    return described(log_density, method=method, pulses=len(yaw_deg))


def amplitude_monopulse(
    boresight_deg: _Floats,
    snr_db: _Floats,
    pattern: AntennaPattern,
    *,
    fading_db: float = SIMPLE.array_fading_db,
) -> Bearing:
    """Estimate a bearing from the levels of the same pulses at several fixed antennas.

    The tag's strength and its fading are common to all antennas at a pulse and cancel out.
    `boresight_deg` (a,) is the direction of each antenna, clockwise from true north. `snr_db`
    (p, a) is the SNR of each pulse at each antenna [dB], NaN if not received. `fading_db` is
    the standard deviation of level differences that are not caused by the direction [dB].
    Raises `UsageError` if no pulse was received by two antennas.
    """
    heard = ~np.isnan(snr_db)
    used = heard.sum(axis=1) >= 2
    if not used.any():
        raise UsageError(
            "no pulse was received by two antennas",
            remedy="Use the boresight of the antenna with the strongest signal",
        )
    gain = pattern.gain_db(difference_deg(GRID_DEG[:, None], boresight_deg[None, :]))
    log_density = np.zeros(len(GRID_DEG))
    for level, there in zip(snr_db[used], heard[used], strict=True):
        s = 10.0 ** (level[there] / 10.0)
        weight = 1.0 / (fading_db**2 + 18.86 * (1.0 + 2.0 * s) / s**2)
        residual = level[there] - gain[:, there]
        mean = (residual @ weight / weight.sum())[:, None]
        log_density -= 0.5 * ((residual - mean) ** 2) @ weight
    return described(log_density, method="amplitude_monopulse", pulses=int(used.sum()))
