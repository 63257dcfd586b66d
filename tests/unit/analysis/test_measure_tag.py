"""Unknown tags measured: against a few lines that make samples, and against the simulator."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from command_line import uavrt
from depth import share
from gapped import GAP_S, KINDS, write_gapped

from uavrt.analysis.measure.measure_tag import measure_tags
from uavrt.analysis.measure.measured_tag import MeasuredTag
from uavrt.analysis.measure.pulse_fit import fit_pulse
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import ConfigError, UsageError
from uavrt.detection.beeps.beats import find_beats
from uavrt.detection.beeps.interval_fit import fit_beat
from uavrt.radio.opening import open_recording
from uavrt_experiments.detection.signals import TruePulse, add_pulse

pytestmark = pytest.mark.slow

CENTER_HZ = 148.7e6


def noise(rng: np.random.Generator, count: int) -> np.ndarray:
    """Complex noise of unit power."""
    parts = rng.standard_normal((count, 2)).astype(np.float32) * np.float32(math.sqrt(0.5))
    return parts.view(np.complex64).ravel()


def add_tag(
    samples: np.ndarray,
    rate_hz: float,
    starts_s: np.ndarray,
    *,
    offset_hz: float,
    width_s: float = 0.02,
    enr_db: float = 25.0,
    drift_hz_per_s: float = 0.0,
) -> None:
    """Add pulses to noise of unit power."""
    amplitude = math.sqrt(10 ** (enr_db / 10) / (width_s * rate_hz))
    for start_s in starts_s:
        first, last = math.ceil(start_s * rate_hz), math.floor((start_s + width_s) * rate_hz)
        t = np.arange(first, last + 1) / rate_hz
        cycles = offset_hz * t + 0.5 * drift_hz_per_s * t**2
        samples[first : last + 1] += (amplitude * np.exp(2j * np.pi * cycles)).astype(
            np.complex64
        )


def beat(
    rng: np.random.Generator, first_s: float, end_s: float, interval_s: float, jitter_s: float
) -> np.ndarray:
    starts = np.arange(first_s, end_s - 0.1, interval_s)
    return starts + rng.uniform(-jitter_s, jitter_s, starts.size)


def measured(
    tmp_path: Path, samples: np.ndarray, rate_hz: float, **options: Any
) -> tuple[MeasuredTag, ...]:
    path = tmp_path / "unknown.cf32"
    samples.astype(np.complex64).tofile(path)
    return measure_tags(
        lambda: open_recording(path, sample_rate_hz=rate_hz, center_frequency_hz=CENTER_HZ),
        **options,
    ).tags


def assert_within(measured: float, sigma: float, true: float, floor: float) -> None:
    """Within four standard deviations, which are themselves no excuse."""
    assert abs(measured - true) < 4.0 * sigma + floor


@pytest.mark.parametrize(
    ("rate_hz", "width_s", "interval_s", "jitter_s", "offset_hz"),
    [
        (3750.0, 0.020, 1.254, 0.010, 400.0),
        (48_000.0, 0.015, 1.333, 0.0, -17_123.0),
        (120_000.0, 0.030, 0.877, 0.002, 45_210.0),
    ],
)
def test_an_unknown_tag_is_found_and_measured_as_well_as_it_says(
    tmp_path: Path,
    rate_hz: float,
    width_s: float,
    interval_s: float,
    jitter_s: float,
    offset_hz: float,
) -> None:
    rng = np.random.default_rng(7)
    samples = noise(rng, round(40 * rate_hz))
    starts = beat(rng, 0.4, 40.0, interval_s, jitter_s)
    add_tag(samples, rate_hz, starts, offset_hz=offset_hz, width_s=width_s)
    (tag,) = measured(tmp_path, samples, rate_hz)
    assert tag.pulses >= 0.95 * starts.size
    assert_within(tag.frequency_hz, tag.frequency_sigma_hz, CENTER_HZ + offset_hz, 0.1)
    assert tag.frequency_sigma_hz < 0.5
    assert_within(tag.pulse_width_s, tag.pulse_width_sigma_s, width_s, 1e-4)
    assert tag.pulse_width_sigma_s < 2e-4
    (rate,) = tag.rates
    assert_within(rate.interval_s, rate.interval_sigma_s, interval_s, 1e-6)
    assert rate.interval_sigma_s < 2e-4
    assert abs(rate.jitter_s - jitter_s / math.sqrt(3)) < 0.3e-3 + 0.25 * jitter_s
    assert abs(rate.drift) < 4.0 * rate.drift_sigma
    assert abs(tag.enr_db - 25.0) < 1.5
    entry = tag.entry(2)
    assert abs(entry.pulse_intervals_s[0] - interval_s) < entry.interval_uncertainty_s
    assert jitter_s <= entry.interval_jitter_s < jitter_s + 0.006


@pytest.mark.parametrize("slide_hz", [400.0, -200.0])
def test_a_slide_of_the_frequency_within_each_pulse_is_measured(
    tmp_path: Path, slide_hz: float
) -> None:
    rate_hz = 48_000.0
    rng = np.random.default_rng(8)
    samples = noise(rng, round(30 * rate_hz))
    starts = beat(rng, 0.4, 30.0, 1.27, 0.003)
    for start_s in starts:
        pulse = TruePulse(start_s=start_s, offset_hz=3210.0, enr_db=25.0, slide_hz=slide_hz)
        add_pulse(samples, pulse, sample_rate_hz=rate_hz, width_s=0.02, phase=rng.uniform(0, 6))
    (tag,) = measured(tmp_path, samples, rate_hz)
    assert tag.pulses >= 0.95 * starts.size
    assert abs(tag.slide_hz - slide_hz) < 20.0
    assert abs(tag.frequency_hz - CENTER_HZ - 3210.0) < 4.0 * tag.frequency_sigma_hz + 2.0
    assert abs(tag.pulse_width_s - 0.02) < 5e-4
    assert abs(tag.enr_db - 25.0) < 1.5
    assert abs(tag.entry(2).frequency_slide_hz - slide_hz) <= 20.0


def test_the_stated_deviations_cover_the_errors(tmp_path: Path) -> None:
    scores = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        interval_s, offset_hz = rng.uniform(0.7, 1.6), rng.uniform(-3000.0, 3000.0)
        samples = noise(rng, 7500 * 25)
        starts = beat(rng, 0.3, 25.0, interval_s, 0.004)
        add_tag(samples, 7500.0, starts, offset_hz=offset_hz, enr_db=20.0)
        tag = measured(tmp_path, samples, 7500.0)[0]
        rate = tag.rates[0]
        scores.append(
            (
                (tag.frequency_hz - CENTER_HZ - offset_hz) / tag.frequency_sigma_hz,
                (rate.interval_s - interval_s) / rate.interval_sigma_s,
                (tag.pulse_width_s - 0.02) / tag.pulse_width_sigma_s,
            )
        )
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    # 12 seeds: an honest deviation gives 1 ± 0.2.
    assert (rms < 1.8).all()
    assert (rms[:2] > 0.4).all()


def test_a_tag_with_two_rates_has_both(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    samples = noise(rng, 16_000 * 60)
    slow = beat(rng, 0.4, 30.0, 1.5, 0.002)
    fast = beat(rng, slow[-1] + 0.9, 60.0, 0.9, 0.002)
    starts = np.concatenate((slow, fast))
    add_tag(samples, 16_000.0, starts, offset_hz=1234.0)
    (tag,) = measured(tmp_path, samples, 16_000.0)
    assert [round(rate.interval_s, 3) for rate in tag.rates] == [0.9, 1.5]
    # The pulse at the switch may go with either.
    assert abs(tag.rates[0].pulses - fast.size) <= 1
    assert sum(rate.pulses for rate in tag.rates) >= starts.size - 1
    assert tag.rates[1].last_time_ns < tag.rates[0].first_time_ns
    assert tag.entry(2).pulse_intervals_s == tuple(round(r.interval_s, 5) for r in tag.rates)


@pytest.mark.parametrize("intervals_s", [(1.333, 2.0), (2.0, 1.333), (1.0, 2.0), (1.5, 0.75)])
def test_rates_in_a_small_ratio_are_one_tag_with_both(
    tmp_path: Path, intervals_s: tuple[float, float]
) -> None:
    rng = np.random.default_rng(3)
    samples = noise(rng, 7500 * 60)
    before = beat(rng, 0.4, 30.0, intervals_s[0], 0.002)
    after = beat(rng, before[-1] + intervals_s[1], 60.0, intervals_s[1], 0.002)
    add_tag(samples, 7500.0, np.concatenate((before, after)), offset_hz=1234.0)
    (tag,) = measured(tmp_path, samples, 7500.0)
    assert sorted(round(rate.interval_s, 2) for rate in tag.rates) == sorted(
        round(interval_s, 2) for interval_s in intervals_s
    )
    assert sum(rate.pulses for rate in tag.rates) == before.size + after.size
    assert sum(rate.missing for rate in tag.rates) == 0


def test_drifts_of_frequency_and_interval_are_seen(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    samples = noise(rng, 7500 * 60)
    number = np.arange(58)
    starts = 0.4 + 1.0 * number + 0.5 * 1e-4 * number**2  # 100 ppm longer at each pulse
    add_tag(samples, 7500.0, starts, offset_hz=500.0, drift_hz_per_s=1.5)
    (tag,) = measured(tmp_path, samples, 7500.0)
    assert_within(tag.drift_hz_per_s, tag.drift_sigma_hz_per_s, 1.5, 0.01)
    (rate,) = tag.rates
    assert_within(rate.drift, rate.drift_sigma, 1e-4, 1e-6)
    assert rate.drift > 4 * rate.drift_sigma
    assert rate.jitter_s < 0.5e-3  # the drift is not taken for jitter


def test_two_tags_a_carrier_a_spur_and_impulses_are_told_apart(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    rate_hz = 48_000.0
    samples = noise(rng, round(40 * rate_hz))
    t = np.arange(samples.size) / rate_hz
    samples += (3.0 * np.exp(2j * np.pi * 5000.0 * t) + 2.0).astype(np.complex64)
    for place in rng.integers(0, samples.size - 3, 60):
        samples[place : place + 3] += 30.0
    add_tag(samples, rate_hz, beat(rng, 0.4, 40.0, 1.254, 0.005), offset_hz=-9000.0, enr_db=40)
    add_tag(samples, rate_hz, beat(rng, 0.7, 40.0, 1.1, 0.005), offset_hz=12_000.0, enr_db=22)
    tags = measured(tmp_path, samples, rate_hz)
    found = sorted((round(tag.frequency_hz - CENTER_HZ, -1), tag.rates) for tag in tags)
    assert [offset_hz for offset_hz, _ in found] == [-9000.0, 12_000.0]
    assert [round(rates[0].interval_s, 2) for _, rates in found] == [1.25, 1.1]


def test_pulses_that_were_not_heard_for_a_while_are_one_beat(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    samples = noise(rng, 7500 * 60)
    starts = beat(rng, 0.4, 60.0, 1.0, 0.003)
    heard = starts[(starts < 20.0) | (starts > 40.0)]
    add_tag(samples, 7500.0, heard, offset_hz=-600.0)
    (tag,) = measured(tmp_path, samples, 7500.0)
    (rate,) = tag.rates
    assert rate.pulses == heard.size
    assert rate.missing == starts.size - heard.size
    assert_within(rate.interval_s, rate.interval_sigma_s, 1.0, 1e-6)


@pytest.mark.parametrize(("rate_hz", "kind"), share([*product((7500.0, 48e3), KINDS)], 5))
def test_behind_a_gap_pulses_keep_their_true_times(
    tmp_path: Path, rate_hz: float, kind: str
) -> None:
    rng = np.random.default_rng(13)
    samples = noise(rng, round(40 * rate_hz))
    starts = beat(rng, 0.4, 40.0, 1.254, 0.002)
    add_tag(samples, rate_hz, starts, offset_hz=900.0)
    start_ns = 1_714_543_200_000_000_000
    gap_s = (19.6, 19.6 + GAP_S)
    path = write_gapped(
        tmp_path / "band",
        samples,
        rate_hz=rate_hz,
        center_hz=CENTER_HZ,
        start_ns=start_ns,
        gap_s=gap_s,
        kind=kind,
    )
    (tag,) = measure_tags(lambda: open_recording(path)).tags
    (rate,) = tag.rates
    lost = np.count_nonzero((starts > gap_s[0] - 0.02) & (starts < gap_s[1]))
    assert rate.pulses >= starts.size - lost - 1
    assert rate.pulses + rate.missing == starts.size
    assert_within(rate.interval_s, rate.interval_sigma_s, 1.254, 1e-6)
    assert rate.jitter_s < 0.002
    middle_ns = start_ns + round((starts[-1] + 0.01) * 1e9)
    assert abs(rate.last_time_ns - middle_ns) < 1_000_000


def test_noise_carriers_and_impulses_alone_are_no_tag(tmp_path: Path) -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        samples = noise(rng, 16_000 * 30)
        t = np.arange(samples.size) / 16_000.0
        samples += (4.0 * np.exp(2j * np.pi * (3000.0 * t + 5.0 * t**2))).astype(np.complex64)
        for place in rng.integers(0, samples.size - 3, 40):
            samples[place : place + 3] += 30.0
        with pytest.raises(UsageError, match="no regular pulses"):
            measured(tmp_path, samples, 16_000.0)


def test_a_hint_leaves_the_other_tag_out(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    samples = noise(rng, 48_000 * 20)
    add_tag(samples, 48_000.0, beat(rng, 0.4, 20.0, 1.254, 0.0), offset_hz=-9000.0)
    add_tag(samples, 48_000.0, beat(rng, 0.7, 20.0, 1.1, 0.0), offset_hz=12_000.0)
    (tag,) = measured(tmp_path, samples, 48_000.0, frequency_hz=CENTER_HZ + 12_500.0)
    assert abs(tag.frequency_hz - CENTER_HZ - 12_000.0) < 1.0
    with pytest.raises(ConfigError, match="outside this recording"):
        measured(tmp_path, samples, 48_000.0, frequency_hz=CENTER_HZ + 90_000.0)


def test_bursts_at_random_make_no_beat() -> None:
    rng = np.random.default_rng(9)
    false = 0
    for _ in range(150):
        times_s = np.sort(rng.uniform(0.0, 60.0, int(rng.integers(5, 40))))
        false += bool(find_beats(times_s, 60.0))
    assert false <= 2


@pytest.mark.parametrize("missing", [0, 3, 8])
def test_a_beat_is_found_among_false_bursts_and_with_pulses_missing(missing: int) -> None:
    rng = np.random.default_rng(10 + missing)
    starts = beat(rng, 1.0, 40.0, 1.254, 0.005)
    heard = np.delete(starts, rng.choice(starts.size, missing, replace=False))
    times_s = np.sort(np.concatenate((heard, rng.uniform(0.0, 40.0, 8))))
    found = find_beats(times_s, 40.0)[0]
    assert abs(found.beat.interval_s - 1.254) < 1e-3
    assert found.members.size >= heard.size - 2


@pytest.mark.parametrize("width_s", [0.008, 0.02, 0.045])
@pytest.mark.parametrize("offset_hz", [-1800.0, 13.0])
def test_a_pulse_is_measured_to_a_part_of_a_sample(width_s: float, offset_hz: float) -> None:
    rng = np.random.default_rng(11)
    rate_hz = 7500.0
    errors = []
    for start_s in rng.uniform(0.100 - width_s / 2 - 0.003, 0.100 - width_s / 2 + 0.003, 20):
        samples = noise(rng, 1500)
        add_tag(
            samples,
            rate_hz,
            np.array([start_s]),
            offset_hz=offset_hz,
            width_s=width_s,
            enr_db=35,
        )
        fit = fit_pulse(samples, sample_rate_hz=rate_hz, frequency_hz=offset_hz + 10.0)
        errors.append(
            (fit.start_s - start_s, fit.width_s - width_s, fit.frequency_hz - offset_hz)
        )
    start_s, width_error_s, frequency_hz = np.sqrt(np.mean(np.square(errors), axis=0))
    assert start_s < 0.25e-3
    assert width_error_s < 0.35e-3
    assert frequency_hz < 0.03 / width_s


def test_the_beat_of_regular_times_is_exact() -> None:
    times_s = 3.0 + 1.254 * np.array([0, 1, 2, 5, 6, 11, 12, 13])
    fitted = fit_beat(times_s, 1.3)
    assert fitted.numbers.tolist() == [0, 1, 2, 5, 6, 11, 12, 13]
    assert abs(fitted.interval_s - 1.254) < 1e-9
    assert abs(fitted.first_s - 3.0) < 1e-9
    assert fitted.scatter_s < 1e-9


def test_the_command_measures_the_simulators_tag_and_writes_its_entry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from uavrt.simulation.scene.flight import Flight, Leg
    from uavrt.simulation.scene.scenario import Radio, Scenario
    from uavrt.simulation.simulated_recording import simulate_to_directory

    scenario = Scenario(
        duration_s=20.0,
        radio=Radio(center_frequency_hz=148_705_000.0, sample_rate_hz=375_000.0),
        tag=(
            made.simulated_tag(
                interval_jitter_s=0.01, north_m=150.0, east_m=60.0, erp_dbm=-30.0
            ),
        ),
        flight=Flight(height_m=40.0, leg=(Leg(duration_s=20.0),)),
    )
    simulate_to_directory(scenario, tmp_path / "flight")
    recording = next((tmp_path / "flight").glob("*.sigmf-meta"))
    entry = tmp_path / "tags.toml"
    command = ("tags", "measure", str(recording), "-o", str(entry))
    assert uavrt(*command, "--id", "6", "--name", "Luna") == 0
    (tag,) = read_tags(entry)
    assert (tag.tag_id, tag.name) == (6, "Luna")
    # The simulated receiver and tag have crystals of their own, some ppm.
    assert abs(tag.frequency_hz - 148_710_000.0) < 1500.0
    assert abs(tag.pulse_width_s - 0.020) < 0.5e-3
    assert abs(tag.pulse_intervals_s[0] - 1.254) < 0.01
    assert "interval" in capsys.readouterr().err
    assert uavrt(*command) == 2
    assert "exists already" in capsys.readouterr().err


def test_an_entry_has_two_rates_at_most_and_room_for_a_season(tmp_path: Path) -> None:
    rng = np.random.default_rng(12)
    samples = noise(rng, 7500 * 20)
    add_tag(samples, 7500.0, beat(rng, 0.4, 20.0, 1.0, 0.0), offset_hz=100.0)
    (tag,) = measured(tmp_path, samples, 7500.0)
    rate = tag.rates[0]
    three = replace(
        tag, rates=(rate, replace(rate, interval_s=2.0), replace(rate, interval_s=3))
    )
    entry = three.entry(4)
    assert entry.pulse_intervals_s[1] == 2.0
    assert len(entry.pulse_intervals_s) == 2
    assert entry.interval_uncertainty_s == 0.020
    assert entry.interval_jitter_s == 0.002
