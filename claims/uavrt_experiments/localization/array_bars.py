"""Experiment A1: bearings from samples through an antenna switch, against their bound.

Samples at 48 kS/s are simulated, with pulses of 20 ms and a switch that stays 0.25 ms at each
position. The detector's errors of time and frequency are added (0.7 ms, 2.5 Hz).
"""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.units import wrap_degrees_360
from uavrt.localization.angles import difference_deg
from uavrt.localization.bearing.array_bearings import (
    Steering,
    circle_steering,
    pair_steering,
    switched_bearing,
)
from uavrt.localization.bearing.switched_pulse import SwitchSchedule, measure_switched_pulse
from uavrt.localization.results import ArrayMethod
from uavrt.simulation.scene.antenna_switch import AntennaSwitch, gate, position_weights
from uavrt_experiments.figures import measured, rms, share
from uavrt_experiments.result import Row

_RATE_HZ = 48_000.0
_WAVELENGTH_M = 2.0
_WIDTH_S = 0.020
_EDGE_S = 0.002
"""Time left out at each end of a pulse [s], as in `uavrt.analysis.measure.switched`."""
_HEADINGS_DEG: dict[str, tuple[float, ...]] = {
    "pseudo_doppler": (0.0,),
    # A pair separates right from left; a quarter turn, ahead from behind.
    "two_point_phased": (0.0, 30.0, 60.0, 90.0),
}


def switched_bound_deg(
    steering: Steering, direction_deg: float, snr: float, counts: NDArray[np.float64]
) -> float:
    """Cramér–Rao bound [deg] of one pulse's direction, with unknown strength and phase.

    `steering`: the array.
    `direction_deg`: direction from the array's nose [deg].
    `snr`: power of an element of unit amplitude over the noise, per sample.
    `counts` (elements,): samples at each position.
    """
    step = 0.01
    around = steering(np.array([direction_deg - step, direction_deg, direction_deg + step]))
    around = around * np.sqrt(counts)
    slope = (around[2] - around[0]) / (2.0 * step)
    along = around[1] / np.linalg.norm(around[1])
    across = slope - along * np.vdot(along, slope)
    return float(1.0 / np.sqrt(2.0 * snr * np.sum(np.abs(across) ** 2)))


def switched(runs: int, seed: int) -> list[Row]:
    """A1: four monopoles on a circle of 0.2 wavelengths, and a pair half a wavelength apart."""
    circle = AntennaSwitch(kind="circle", size_m=0.2 * _WAVELENGTH_M)
    pair = AntennaSwitch(kind="sum_difference", size_m=0.5 * _WAVELENGTH_M)
    results = []
    for enr_db in (16.0, 26.0):
        results += _lines(circle, circle_steering(4, 0.2), "pseudo_doppler", enr_db, runs, seed)
        results += _lines(pair, pair_steering(0.5), "two_point_phased", enr_db, runs, seed)
    return results


def _lines(
    switch: AntennaSwitch,
    steering: Steering,
    method: ArrayMethod,
    enr_db: float,
    runs: int,
    seed: int,
) -> list[Row]:
    rng = np.random.default_rng(seed)
    headings = np.array(_HEADINGS_DEG[method])
    errors, covered, bounds = [], [], []
    for _ in range(runs):
        truth = float(rng.uniform(0.0, 360.0))
        found = _heard(rng, switch, steering, method, enr_db, truth, headings)
        errors.append(difference_deg(found[0], truth))
        low, high = found[1]
        covered.append(float(wrap_degrees_360(truth - low) <= wrap_degrees_360(high - low)))
        bounds.append(_bound_deg(switch, steering, enr_db, truth - headings))
    count = len(headings)
    condition = f"{method}, {count} pulse{'s' if count > 1 else ''}, {enr_db:g} dB"
    bound = float(rms(np.array(bounds)))
    return [
        measured("A1", condition, "rms [°]", errors, rms, most=1.2 * bound, bound=bound),
        measured("A1", condition, "90 % interval holds", covered, share, least=0.86),
    ]


def _heard(
    rng: Generator,
    switch: AntennaSwitch,
    steering: Steering,
    method: ArrayMethod,
    enr_db: float,
    truth_deg: float,
    headings_deg: NDArray[np.float64],
) -> tuple[float, tuple[float, float]]:
    """Bearing and its interval, from the samples of one pulse at each heading."""
    schedule = SwitchSchedule(
        positions=switch.positions,
        dwell_samples=switch.dwell_samples(_RATE_HZ),
        settle_samples=switch.settle_samples(_RATE_HZ),
    )
    pulses = []
    for heading in headings_deg:
        begin = int(rng.integers(100_000))
        samples = _pulse(rng, switch, enr_db, truth_deg - heading, begin)
        late = round(float(rng.normal(0.0, 0.7e-3)) * _RATE_HZ)
        first = len(samples) // 3 + late + round(_EDGE_S * _RATE_HZ)
        used = samples[first : first + round((_WIDTH_S - 2 * _EDGE_S) * _RATE_HZ)]
        pulses.append(
            measure_switched_pulse(
                used,
                schedule,
                first_sample=begin + first,
                frequency_hz=1_234.5 + float(rng.normal(0.0, 2.5)),
                sample_rate_hz=_RATE_HZ,
            )
        )
    found = switched_bearing(
        np.stack([one.amplitudes for one in pulses]),
        np.stack([one.counts for one in pulses]),
        headings_deg,
        steering,
        noise_power=np.array([one.noise_power for one in pulses]),
        method=method,
    )
    assert found.interval90_deg is not None
    return found.bearing_deg, found.interval90_deg


def _pulse(
    rng: Generator, switch: AntennaSwitch, enr_db: float, direction_deg: float, begin: int
) -> NDArray[np.complex64]:
    """Samples of a pulse in noise of power 1, with one pulse width of noise before
    and after.
    """
    width = round(_WIDTH_S * _RATE_HZ)
    noise = rng.normal(0.0, np.sqrt(0.5), (2, 3 * width))
    samples: NDArray[np.complex64] = (noise[0] + 1j * noise[1]).astype(np.complex64)
    angle = np.radians(direction_deg)
    weights = position_weights(switch, (np.cos(angle), np.sin(angle), 0.0), _WAVELENGTH_M)
    time_s = np.arange(width) / _RATE_HZ
    wave = np.sqrt(10.0 ** (enr_db / 10.0) / width) * np.exp(
        2j * np.pi * (1_234.5 * time_s + rng.random())
    )
    samples[width : 2 * width] += wave * gate(switch, weights, begin + width, width, _RATE_HZ)
    return samples


def _bound_deg(
    switch: AntennaSwitch,
    steering: Steering,
    enr_db: float,
    directions_deg: NDArray[np.float64],
) -> float:
    """Cramér–Rao bound [deg] of all pulses together, for the samples that are used."""
    dwell, settle = switch.dwell_samples(_RATE_HZ), switch.settle_samples(_RATE_HZ)
    used = (_WIDTH_S - 2 * _EDGE_S) * _RATE_HZ * (dwell - settle) / dwell
    counts = np.full(switch.positions, used / switch.positions)
    # A pair's sum and difference, as the steering has them, are √2 of a lossless hybrid's.
    scale = 1.0 if switch.kind == "circle" else 0.5
    snr = scale * 10.0 ** (enr_db / 10.0) / (_WIDTH_S * _RATE_HZ)
    each = [switched_bound_deg(steering, float(one), snr, counts) for one in directions_deg]
    return float(np.sum(np.array(each) ** -2.0) ** -0.5)
