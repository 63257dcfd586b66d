"""The detector as its users call it: blocks of samples in, pulses out."""

import itertools
import math
from dataclasses import replace

import made
import numpy as np
import pytest
from some import some
from streams import fed, sent

from uavrt.core.errors import ConfigError
from uavrt.detection.modes import OperatingMode
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples, noise
from uavrt_experiments.detection.trials import blocks_of, compare, detect

pytestmark = pytest.mark.slow


def rotating_enr_db(time_s: float) -> float:
    """30 degrees a second; 24 dB ahead, 2 dB behind."""
    angle = math.radians(30.0 * time_s)
    return 13.0 + 11.0 * math.cos(angle)


@pytest.mark.parametrize("rate_hz", [3750.0, 7500.0, 7575.7])
def test_every_pulse_of_a_clear_tag_is_found_once_at_any_sample_rate(rate_hz: float) -> None:
    truth, samples = sent(
        10, 30.0, 20.0, rate_hz=rate_hz, interval_s=1.27, offset_hz=333.0, jitter_s=0.005
    )
    pulses, detector = detect(samples, THESIS_TAG, sample_rate_hz=rate_hz)
    result = compare(pulses, truth, THESIS_TAG)
    assert result.matched == len(truth)
    assert result.false == 0
    assert len(pulses) == len(truth) == detector.counters.pulses
    assert math.sqrt(np.mean(np.square(result.time_errors_s))) < 1.5e-3
    assert math.sqrt(np.mean(np.square(result.frequency_errors_hz))) < 3.5
    assert abs(np.mean(result.snr_errors_db)) < 0.7
    # Groups are numbered upwards, their pulses from 1.
    keys = [(pulse.group_sequence, pulse.group_index) for pulse in pulses]
    assert len(set(keys)) == len(keys)
    assert {index for _, index in keys} == {1, 2, 3}
    assert {sequence for sequence, _ in keys} == set(range(1, max(keys)[0] + 1))


def test_a_turning_antenna_loses_no_pulse_that_is_strong_enough() -> None:
    detectable = found = false = 0
    for seed in range(20, 23):
        truth, samples = sent(seed, 60.0, rotating_enr_db, offset_hz=-120.0, jitter_s=0.005)
        pulses, _ = detect(samples, THESIS_TAG, frequency_window_hz=500.0)
        result = compare(pulses, truth, THESIS_TAG)
        strong = [seen for seen, p in zip(result.found, truth, strict=True) if p.enr_db >= 14.0]
        detectable += len(strong)
        found += sum(strong)
        false += result.false_confirmed
    assert false <= 3
    assert detectable > 60
    assert found / detectable >= 0.95


@pytest.mark.parametrize(("seed", "duration_s", "count"), [(30, 4.2, 4), (31, 2.66, 3)])
def test_no_pulse_is_missed_at_the_start_of_a_stream_nor_one_that_just_ended(
    seed: int, duration_s: float, count: int
) -> None:
    truth, samples = sent(seed, duration_s, 17.0, first_s=0.1)
    pulses, _ = detect(samples, THESIS_TAG)
    assert compare(pulses, truth, THESIS_TAG).matched == len(truth) == count


def test_the_next_pulse_lies_where_a_confirmed_one_predicts_it() -> None:
    _, samples = sent(33, 60.0, 18.0, interval_s=1.29, offset_hz=50.0, jitter_s=0.005)
    pulses = sorted(detect(samples, THESIS_TAG)[0], key=lambda p: p.start_time_ns)
    inside = 0
    for now, then in itertools.pairwise(pulses[3:]):
        inside += some(now.predicted_next_start_ns) <= then.start_time_ns
        inside += then.end_time_ns <= some(now.predicted_next_end_ns)
    assert inside >= 0.98 * 2 * (len(pulses) - 4)


def test_lost_blocks_lose_their_pulses_only() -> None:
    rng = np.random.default_rng(34)
    truth = made.train(rng, 60.0, 18.0)
    samples = make_samples(rng, truth, duration_s=60.0)
    detector = made.detector(THESIS_TAG)
    pulses = []
    lost = 0
    there = np.ones(len(samples), bool)
    for first in range(0, len(samples), 327):
        if rng.uniform() < 0.05 or 100_000 < first < 108_000:
            lost += len(samples[first : first + 327])
            there[first : first + 327] = False
            continue
        time_ns = START_NS + round(first / 3750.0 * 1e9)
        pulses += detector.process(samples[first : first + 327], time_ns)
    pulses += detector.flush()
    result = compare(pulses, truth, THESIS_TAG)
    assert result.false_confirmed == 0
    heard = [there[round(p.start_s * 3750) :][:75].mean() > 0.6 for p in truth]
    assert 35 < sum(heard) < len(truth)
    assert all(seen for seen, whole in zip(result.found, heard, strict=True) if whole)
    assert abs(detector.counters.samples_lost - lost) <= 327


def test_a_group_with_a_pulse_in_a_hole_is_judged_by_the_others() -> None:
    # Two strong pulses carry a group whose third place holds nothing but lost samples.
    truth, samples = sent(36, 20.0, 18.0, first_s=0.2)
    lost_s = [(p.start_s - 0.3, p.start_s + 0.4) for p in truth[2::3]]
    detector = made.detector(THESIS_TAG)
    pulses = []
    for first, (block, time_ns) in enumerate(blocks_of(samples, block=75)):
        if not any(begin_s <= 0.02 * first < end_s for begin_s, end_s in lost_s):
            pulses += detector.process(block, time_ns)
    result = compare(pulses + detector.flush(), truth, THESIS_TAG)
    assert all(seen for index, seen in enumerate(result.found) if index % 3 != 2)
    assert result.false_confirmed == 0


def test_stale_and_repeated_blocks_are_refused_and_counted() -> None:
    truth, samples = sent(35, 20.0, 20.0)
    detector = made.detector(THESIS_TAG)
    pulses = []
    for number, block in enumerate(blocks_of(samples, block=375)):
        for _ in range(1 if number % 10 else 2):
            pulses += detector.process(*block)
    pulses += detector.flush()
    assert detector.counters.blocks_stale == 20
    assert compare(pulses, truth, THESIS_TAG).matched == len(truth) == len(pulses)


def test_searching_without_finding_is_reported_once_a_second_with_the_noise() -> None:
    detector = made.detector(THESIS_TAG)
    fed(detector, 2.0 * noise(np.random.default_rng(37), 75_000))
    reports = detector.search_reports()
    assert 14 <= len(reports) <= 19
    assert all(0.0 < report.best_score < 1.0 for report in reports)
    assert reports[-1].noise_psd == pytest.approx(4.0 / 3750.0, rel=0.1)
    assert detector.search_reports() == []


@pytest.mark.parametrize(
    ("tag", "center_hz"),
    [
        (THESIS_TAG, 148_713_000.0),
        (replace(THESIS_TAG, k=0), THESIS_TAG.frequency_hz),
        (replace(THESIS_TAG, false_alarm_probability=1.0), THESIS_TAG.frequency_hz),
        (replace(THESIS_TAG, pulse_intervals_s=(0.05,)), THESIS_TAG.frequency_hz),
        (replace(THESIS_TAG, pulse_width_s=0.0005), THESIS_TAG.frequency_hz),
    ],
)
def test_a_tag_that_cannot_be_searched_is_refused_with_a_remedy(
    tag: object, center_hz: float
) -> None:
    with pytest.raises(ConfigError) as refusal:
        made.detector(tag, center_frequency_hz=center_hz)  # type: ignore[arg-type]
    assert refusal.value.remedy


@pytest.mark.parametrize("window_hz", [math.inf, 400.0])
@pytest.mark.parametrize("offset_hz", [1870.0, -1870.0, 1875.0])
def test_a_tag_at_the_edge_of_the_channel_is_reported_where_it_is(
    offset_hz: float, window_hz: float
) -> None:
    truth, samples = sent(41, 15.0, 16.0, offset_hz=offset_hz)
    tag = replace(THESIS_TAG, frequency_hz=THESIS_TAG.frequency_hz + offset_hz)
    pulses, _ = detect(
        samples, tag, center_frequency_hz=THESIS_TAG.frequency_hz, frequency_window_hz=window_hz
    )
    result = compare(pulses, truth, THESIS_TAG)
    assert result.matched == len(truth)
    assert result.false == 0
    assert max(map(abs, result.frequency_errors_hz)) < 15.0


@pytest.mark.parametrize(
    ("mode", "offset_hz"),
    [(OperatingMode.SEARCH_SOFT_LOCK, 1870.0), (OperatingMode.ALL_NEVER_LOCK, -1870.0)],
)
def test_a_stranger_at_the_edge_of_the_channel_is_reported_where_it_is(
    offset_hz: float, mode: OperatingMode
) -> None:
    truth, samples = sent(42, 60.0, 16.0, offset_hz=offset_hz)
    pulses, _ = detect(samples, THESIS_TAG, operating_mode=mode)
    result = compare(pulses, truth, THESIS_TAG)
    assert result.matched == len(truth)
    assert result.false_confirmed == 0
    # Nothing of it at the other edge, nor anywhere else; what is left is the noise's.
    own_hz = THESIS_TAG.frequency_hz + offset_hz
    strange = [p for p in pulses if abs(p.frequency_hz - own_hz) > 50.0]
    assert all(abs(p.frequency_hz - THESIS_TAG.frequency_hz) < 1700.0 for p in strange)
    assert result.false == len(strange)
    # Of the whole channel's noise 0.17 groups are expected in so long; more than 1 in 1.3 %.
    assert len({p.group_sequence for p in strange}) <= 1


def test_a_hard_lock_holds_a_tag_at_the_edge_of_the_channel() -> None:
    truth, samples = sent(43, 40.0, 16.0, offset_hz=-1870.0)
    hard = OperatingMode.SEARCH_HARD_LOCK
    pulses, detector = detect(samples, THESIS_TAG, operating_mode=hard)
    result = compare(pulses, truth, THESIS_TAG)
    assert result.matched == len(truth)
    assert result.false_confirmed == 0
    locked_hz = some(detector.locked_frequency_hz)
    assert abs(locked_hz - THESIS_TAG.frequency_hz + 1870.0) < 15.0
