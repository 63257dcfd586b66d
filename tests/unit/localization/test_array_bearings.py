"""Switched and fixed antennas, from samples to bearings, near their bounds."""

import numpy as np
import pytest
from numpy.typing import NDArray
from switched_amplitudes import switched_amplitudes

from uavrt.core.errors import UsageError
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.bearing.array_bearings import (
    Steering,
    amplitude_monopulse,
    circle_steering,
    pair_steering,
    switched_bearing,
)
from uavrt.localization.results import ArrayMethod
from uavrt_experiments.localization.array_bars import switched_bound_deg

RATE_HZ = 48_000.0
PULSE = 960  # 20 ms


def pulse_of(
    rng: np.random.Generator,
    steering: Steering,
    direction_deg: float,
    snr: float,
    selected: NDArray[np.intp],
    frequency_hz: float = 1_234.5,
) -> NDArray[np.complex64]:
    """Samples of a receiver whose antenna switch is stepped, noise power 1."""
    elements = steering(np.array([direction_deg]))[0]
    time = np.arange(len(selected)) / RATE_HZ
    wave = np.sqrt(snr) * elements[selected]
    wave *= np.exp(2j * np.pi * (frequency_hz * time + rng.random()))
    noise = rng.normal(size=(2, len(time))) / np.sqrt(2)
    return np.asarray(wave + noise[0] + 1j * noise[1], np.complex64)


@pytest.mark.parametrize(
    ("method", "steering", "elements", "from_deg", "to_deg"),
    [
        ("pseudo_doppler", circle_steering(4, 0.2), 4, 0.0, 360.0),
        ("two_point_phased", pair_steering(0.5), 2, -60.0, 60.0),
    ],
)
def test_one_pulse_of_a_switched_array_gives_its_direction_at_the_bound(
    method: ArrayMethod, steering: Steering, elements: int, from_deg: float, to_deg: float
) -> None:
    rng = np.random.default_rng(41)
    selected = (np.arange(PULSE) // 12) % elements
    errors, bounds, covered = [], [], 0
    for _ in range(150):
        direction = float(rng.uniform(from_deg, to_deg))
        samples = pulse_of(rng, steering, direction, 0.5, selected)
        amplitudes, counts = switched_amplitudes(
            samples, selected, frequency_hz=1_234.5, sample_rate_hz=RATE_HZ, elements=elements
        )
        found = switched_bearing(
            amplitudes[None, :],
            counts[None, :],
            np.array([77.0]),
            steering,
            noise_power=1.0,
            method=method,
        )
        error = difference_deg(found.bearing_deg, 77.0 + direction)
        if method == "two_point_phased" and abs(error) > 25.0:
            # A pair alone cannot tell ahead from behind, and says so.
            assert found.second_lobe_probability == pytest.approx(0.5, abs=0.1)
            error = difference_deg(found.bearing_deg, 77.0 + 180.0 - direction)
        errors.append(error)
        bounds.append(switched_bound_deg(steering, direction, 0.5, counts))
        low, high = found.interval90_deg or (0.0, 0.0)
        covered += (77.0 + direction - low) % 360.0 <= (high - low) % 360.0
    assert np.sqrt(np.mean(np.square(errors))) < 1.15 * np.sqrt(np.mean(np.square(bounds)))
    assert np.sqrt(np.mean(np.square(bounds))) < 6.0
    if method == "pseudo_doppler":
        assert 123 <= covered <= 146  # 90 % of 150: with a probability of 99 %


def test_a_pair_that_turns_a_little_tells_ahead_from_behind() -> None:
    rng = np.random.default_rng(42)
    steering = pair_steering(0.5)
    selected = np.arange(PULSE) // 12 % 2
    yaw = np.array([0.0, 25.0, 50.0])
    parts = [
        switched_amplitudes(
            pulse_of(rng, steering, 200.0 - heading, 1.0, selected),
            selected,
            frequency_hz=1_234.5,
            sample_rate_hz=RATE_HZ,
            elements=2,
        )
        for heading in yaw
    ]
    found = switched_bearing(
        np.stack([part[0] for part in parts]),
        np.stack([part[1] for part in parts]),
        yaw,
        steering,
        noise_power=1.0,
        method="two_point_phased",
    )
    assert abs(difference_deg(found.bearing_deg, 200.0)) < 5.0
    assert found.second_lobe_probability is not None
    assert found.second_lobe_probability < 0.01


def test_a_settling_switch_is_left_out_and_a_missing_position_is_refused() -> None:
    selected = np.where(np.arange(PULSE) % 12 < 3, -1, (np.arange(PULSE) // 12) % 4)
    steering = circle_steering(4, 0.2)
    samples = pulse_of(np.random.default_rng(43), steering, 30.0, 100.0, np.abs(selected))
    given = {"frequency_hz": 1_234.5, "sample_rate_hz": RATE_HZ, "elements": 4}
    amplitudes, counts = switched_amplitudes(samples, selected, **given)  # type: ignore[arg-type]
    assert counts.tolist() == [180.0] * 4
    assert np.abs(amplitudes) == pytest.approx([10.0] * 4, rel=0.05)
    with pytest.raises(UsageError, match="switch"):
        switched_amplitudes(samples, np.minimum(selected, 2), **given)  # type: ignore[arg-type]


def test_fixed_antennas_are_compared_pulse_by_pulse_whatever_the_fading() -> None:
    rng = np.random.default_rng(44)
    boresights = np.array([0.0, 90.0, 180.0, 270.0])
    pattern = PATTERNS["RA-23K"]
    errors = []
    for _ in range(100):
        bearing = float(rng.uniform(0, 360))
        common = rng.normal(0, 8.0, (4, 1))  # the animal turns: 8 dB, the same for all
        level = 30.0 + common + pattern.gain_db(bearing - boresights) + rng.normal(0, 2, (4, 4))
        level[level < 6.0] = np.nan
        errors.append(
            difference_deg(amplitude_monopulse(boresights, level, pattern).bearing_deg, bearing)
        )
    assert np.sqrt(np.mean(np.square(errors))) < 9.0
    with pytest.raises(UsageError, match="two antennas"):
        amplitude_monopulse(boresights, np.array([[12.0, np.nan, np.nan, np.nan]]), pattern)
