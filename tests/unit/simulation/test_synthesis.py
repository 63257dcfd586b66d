from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt.simulation.scene.scenario import Interferer, Radio
from uavrt.simulation.scene.world import World
from uavrt.simulation.synthesis import CHUNK_SAMPLES, IQSynthesizer, encode, phasor

SECOND_NS = 10**9
RATE_HZ = 48_000.0


def power_spectrum(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    window = np.hanning(samples.size)
    spectrum = np.abs(np.fft.fft(samples * window)) ** 2
    return np.fft.fftfreq(samples.size, 1 / RATE_HZ), spectrum


def test_the_energy_of_pulses_in_the_samples_is_the_true_one() -> None:
    """Measured by correlation with the true carrier, over noise measured between the pulses."""
    scenario = made.still_scenario()
    start_ns = scenario.start_time_ns
    pulses = World(scenario).truth(start_ns, start_ns + 100 * SECOND_NS)
    samples = IQSynthesizer(scenario).block(0, 100 * int(RATE_HZ))
    noise_power = np.mean(
        [
            np.mean(np.abs(samples[at + 4000 : at + 40000]) ** 2)
            for at in _starts(pulses, start_ns)
        ]
    )
    ratios = []
    for pulse, begin in zip(pulses, _starts(pulses, start_ns), strict=True):
        count = round(0.02 * RATE_HZ)
        tone = np.exp(2j * np.pi * (pulse.frequency_hz - 150e6) / RATE_HZ * np.arange(count))
        correlation = np.vdot(tone, samples[begin : begin + count])
        ratios.append(abs(correlation) ** 2 / count / noise_power - 1.0)
    # One pulse of 13 dB has a relative standard deviation of √(2/20): 100 pulses 3.2 %.
    true_ratio = 10.0 ** (pulses[0].enr_db / 10.0)
    assert pulses[0].enr_db == pytest.approx(13.0, abs=0.1)
    assert np.mean(ratios) == pytest.approx(true_ratio, rel=0.1)


def _starts(pulses: list, start_ns: int) -> list[int]:  # type: ignore[type-arg]
    return [int(np.ceil((p.start_time_ns - start_ns) * 1e-9 * RATE_HZ)) for p in pulses]


def test_time_frequency_and_amplitude_of_a_strong_pulse_are_the_true_ones() -> None:
    tag = replace(made.STILL_TAG, erp_dbm=-20.0, frequency_offset_hz=-2345.0)
    scenario = made.still_scenario(tag=(tag,))
    pulse = World(scenario).truth(scenario.start_time_ns, scenario.start_time_ns + SECOND_NS)[0]
    samples = IQSynthesizer(scenario).block(0, int(RATE_HZ))
    loud = np.flatnonzero(np.abs(samples) > pulse.amplitude / 2)
    first_s, last_s = loud[0] / RATE_HZ, (loud[-1] + 1) / RATE_HZ
    assert first_s == pytest.approx(0.5, abs=1.5 / RATE_HZ)
    assert last_s == pytest.approx(0.52, abs=1.5 / RATE_HZ)
    inside = samples[loud[0] : loud[-1] + 1]
    turns = np.diff(np.unwrap(np.angle(inside))).mean() / (2 * np.pi)
    assert turns * RATE_HZ + 150e6 == pytest.approx(pulse.frequency_hz, abs=0.5)
    assert np.abs(inside).mean() == pytest.approx(pulse.amplitude, rel=0.01)


def test_every_pulse_has_its_own_phase() -> None:
    scenario = made.still_scenario()
    start = scenario.start_time_ns
    phases = [p.phase_rad for p in World(scenario).truth(start, start + 400 * SECOND_NS)]
    assert abs(np.exp(1j * np.array(phases)).mean()) < 0.15


def test_noise_is_white_gaussian_and_as_strong_as_asked() -> None:
    samples = IQSynthesizer(made.still_scenario(tag=())).block(0, 200_000)
    assert np.sqrt(np.mean(np.abs(samples) ** 2)) == pytest.approx(5e-3, rel=0.01)
    assert abs(np.mean(samples**2)) < 0.02 * 25e-6
    assert abs(np.vdot(samples[1:], samples[:-1])) / 200_000 < 0.02 * 25e-6
    assert np.mean((samples.real / samples.real.std()) ** 4) == pytest.approx(3.0, abs=0.1)


def test_noise_power_goes_with_the_bandwidth() -> None:
    narrow = IQSynthesizer(made.still_scenario(tag=()), sample_rate_hz=RATE_HZ / 16)
    rms = np.sqrt(np.mean(np.abs(narrow.block(0, 100_000)) ** 2))
    assert rms == pytest.approx(5e-3 / 4, rel=0.02)


def test_gain_changes_signal_and_noise_alike() -> None:
    scenario = made.still_scenario(tag=(replace(made.STILL_TAG, erp_dbm=-30.0),))
    full = IQSynthesizer(scenario, gain=21).block(0, 30_000)
    less = IQSynthesizer(scenario, gain=11).block(0, 30_000)
    # Ten steps of 2 dB.
    np.testing.assert_allclose(less * 10.0, full, rtol=1e-4, atol=1e-8)


def test_another_noise_for_every_chunk_and_seed() -> None:
    synthesizer = IQSynthesizer(made.still_scenario(tag=()))
    first, second = synthesizer.chunk(0).copy(), synthesizer.chunk(1).copy()
    other = IQSynthesizer(made.still_scenario(tag=(), seed=6)).chunk(0)
    for samples in (second, other):
        assert abs(np.vdot(first, samples)) < 5 * 25e-6 * np.sqrt(CHUNK_SAMPLES)


def test_a_carrier_has_its_frequency_and_power_and_no_seams() -> None:
    carrier = Interferer(kind="carrier", frequency_hz=150_004_321.0, power_dbm=-90.0)
    synthesizer = IQSynthesizer(made.still_scenario(tag=(), interferer=(carrier,)))
    samples = synthesizer.block(CHUNK_SAMPLES - 24_000, 48_000)
    frequencies, spectrum = power_spectrum(samples)
    assert frequencies[spectrum.argmax()] == pytest.approx(4321.0, abs=1.0)
    # -90 dBm over the noise of -165.975 dBm/Hz in 48 kHz: 29.16 dB.
    tone = np.exp(2j * np.pi * 4321.0 / RATE_HZ * np.arange(48_000))
    ratio = abs(np.vdot(tone, samples) / 48_000) ** 2 / 25e-6
    assert 10 * np.log10(ratio) == pytest.approx(29.16, abs=0.2)


def test_the_radio_has_an_offset_at_its_centre() -> None:
    scenario = made.still_scenario(
        tag=(), radio=Radio(sample_rate_hz=RATE_HZ, center_frequency_hz=150e6, dc_offset=0.01)
    )
    mean = IQSynthesizer(scenario).block(0, 50_000).mean()
    assert mean == pytest.approx(0.01 + 0.01j, abs=3e-4)


def test_a_mistuned_radio_hears_everything_shifted() -> None:
    radio = Radio(sample_rate_hz=RATE_HZ, center_frequency_hz=150e6, tuning_error_ppm=2.0)
    tag = replace(made.STILL_TAG, erp_dbm=-20.0)
    synthesizer = IQSynthesizer(made.still_scenario(tag=(tag,), radio=radio))
    frequencies, spectrum = power_spectrum(synthesizer.block(24_000, 960))
    assert frequencies[spectrum.argmax()] == pytest.approx(1000.0 - 300.0, abs=50.0)


def test_a_fast_sample_clock_takes_more_samples_in_a_second() -> None:
    radio = Radio(
        sample_rate_hz=RATE_HZ, center_frequency_hz=150e6, sample_rate_error_ppm=100.0
    )
    scenario = made.still_scenario(radio=radio)
    index = IQSynthesizer(scenario).index_at(scenario.start_time_ns + 1000 * SECOND_NS)
    assert index == pytest.approx(48_000_000 + 4_800, abs=1)


def test_impulses_come_at_their_rate_and_are_loud() -> None:
    clicks = Interferer(
        kind="impulses", power_dbm=-70.0, impulses_per_s=5.0, impulse_width_s=2e-5
    )
    scenario = made.still_scenario(tag=(), interferer=(clicks,))
    samples = IQSynthesizer(scenario).block(0, 40 * int(RATE_HZ))
    loud = np.flatnonzero(np.abs(samples) > 0.05)
    events = 1 + np.count_nonzero(np.diff(loud) > 10)
    # 200 ± 14 in the mean; the amplitude is Rayleigh, so a few stay below the threshold.
    assert 150 < events < 245


def test_what_is_too_strong_is_clipped() -> None:
    scenario = made.still_scenario(tag=(replace(made.STILL_TAG, erp_dbm=20.0),))
    parts = IQSynthesizer(scenario).block(0, 48_000).view(np.float32)
    assert parts.max() == 1.0
    assert parts.min() == -1.0


def test_a_tag_outside_the_band_does_not_fold_into_it() -> None:
    far = replace(made.STILL_TAG, erp_dbm=0.0, frequency_hz=150e6 + RATE_HZ)
    samples = IQSynthesizer(made.still_scenario(tag=(far,))).block(0, 48_000)
    assert np.abs(samples).max() < 0.05


def test_before_its_start_the_world_is_only_noise() -> None:
    synthesizer = IQSynthesizer(made.still_scenario())
    samples = synthesizer.block(-100_000, 90_000)
    assert np.sqrt(np.mean(np.abs(samples) ** 2)) == pytest.approx(5e-3, rel=0.02)


def test_a_phasor_is_a_tone() -> None:
    expected = 0.3 * np.exp(1j * (2 * np.pi * 0.123456 * np.arange(1000) + 0.5))
    np.testing.assert_allclose(phasor(0.123456, 1000, 0.5, 0.3), expected, atol=1e-6)
    assert phasor(0.1, 0, 0.0, 1.0).size == 0


def test_samples_are_written_as_little_endian_pairs() -> None:
    samples = np.array([0.5 - 0.25j, -1.0 + 1.0j], dtype=np.complex64)
    assert encode(samples, "cf32") == np.array([0.5, -0.25, -1.0, 1.0], "<f4").tobytes()
    assert encode(samples, "cs16") == np.array([16384, -8192, -32767, 32767], "<i2").tobytes()
