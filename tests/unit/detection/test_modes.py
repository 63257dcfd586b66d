"""What a detector does with a frequency once found: the four modes, each different."""

from dataclasses import replace
from itertools import pairwise

import made
import numpy as np
import pytest
from streams import fed, sent, start_s

from uavrt.detection.detector import PulseDetector
from uavrt.detection.modes import LOCK_HALF_WIDTH_HZ, OperatingMode
from uavrt.detection.search.grid import make_grid
from uavrt.detection.search.rate_hypotheses import make_searches
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, TruePulse, make_samples
from uavrt_experiments.detection.trials import compare, detect

HARD = OperatingMode.SEARCH_HARD_LOCK
SOFT = OperatingMode.SEARCH_SOFT_LOCK
NEVER = OperatingMode.ALL_NEVER_LOCK
RATE_HZ = 3750.0


def make_detector(mode: OperatingMode) -> PulseDetector:
    return made.detector(THESIS_TAG, RATE_HZ, frequency_window_hz=500.0, operating_mode=mode)


def two_places(
    rng: np.random.Generator, offsets_hz: tuple[float, float]
) -> tuple[np.ndarray, list[TruePulse], list[TruePulse]]:
    """A tag that is silent for 16 s in the middle and then sends at another frequency."""
    first = made.train(rng, 15.0, 20.0, offset_hz=offsets_hz[0])
    then = made.train(rng, 50.0, 20.0, offset_hz=offsets_hz[1], first_s=31.0)
    return make_samples(rng, first + then, duration_s=50.0), first, then


@pytest.mark.parametrize(("mode", "found"), [(HARD, 0), (SOFT, 15)])
def test_only_a_soft_lock_follows_a_tag_to_another_frequency(
    mode: OperatingMode, found: int
) -> None:
    samples, first, then = two_places(np.random.default_rng(800), (300.0, -250.0))
    detector = make_detector(mode)
    pulses = fed(detector, samples)
    assert compare(pulses, first, THESIS_TAG).matched >= len(first) - 1
    assert compare(pulses, then, THESIS_TAG).matched == pytest.approx(found, abs=1)
    assert (detector.locked_frequency_hz is not None) == (mode is HARD)


def test_a_hard_lock_finds_its_tag_again_after_a_silence_and_ends_with_a_reset() -> None:
    samples, first, then = two_places(np.random.default_rng(801), (300.0, 280.0))
    detector = make_detector(HARD)
    pulses = fed(detector, samples)
    assert compare(pulses, first + then, THESIS_TAG).matched >= len(first + then) - 2
    assert detector.locked_frequency_hz == pytest.approx(
        THESIS_TAG.frequency_hz + 300.0, abs=5.0
    )
    samples, first, _ = two_places(np.random.default_rng(803), (-250.0, -250.0))
    later_ns = START_NS + 1_000_000_000_000
    # A jump of the clock begins the stream anew; the lock outlives it.
    found = fed(detector, samples[: round(15 * RATE_HZ)], start_ns=later_ns)
    # The last pulses of the first stream are found when it ends.
    assert [pulse for pulse in found if pulse.start_time_ns >= later_ns] == []
    detector.reset()
    assert detector.locked_frequency_hz is None
    pulses = fed(detector, samples, start_ns=later_ns + 100_000_000_000)
    shifted = [p for p in pulses if p.frequency_hz < THESIS_TAG.frequency_hz]
    assert len(shifted) >= len(first) - 1


def test_a_hard_lock_goes_with_a_tag_that_drifts() -> None:
    truth, samples = sent(803, 80.0, 16.0, offset_hz=-120.0, drift_hz_per_s=4.0)
    detector = make_detector(HARD)
    pulses = fed(detector, samples)
    assert compare(pulses, truth, THESIS_TAG).matched >= len(truth) - 2
    assert detector.locked_frequency_hz == pytest.approx(
        THESIS_TAG.frequency_hz - 120.0 + 4.0 * 80.0, abs=60.0
    )


def test_a_locked_band_has_a_lower_threshold_for_the_same_false_alarms() -> None:
    thresholds = []
    for half_width_hz in (LOCK_HALF_WIDTH_HZ, 500.0, 1e6):
        grid = make_grid(
            sample_rate_hz=RATE_HZ,
            pulse_width_s=0.02,
            offset_hz=300.0,
            half_width_hz=half_width_hz,
        )
        thresholds.append(make_searches(THESIS_TAG, grid, half_width_hz)[0].threshold)
    locked, window, channel = thresholds
    # Each is worth about 0.25 dB at K = 3.
    assert locked < 0.95 * window < 0.95**2 * 1.02 * channel


def test_without_a_lock_every_pulse_is_in_one_group_and_the_groups_are_numbered() -> None:
    truth, samples = sent(805, 40.0, 16.0, interval_s=1.27, offset_hz=-700.0, jitter_s=0.005)
    # A window of frequencies bounds the other modes alone.
    pulses, _ = detect(samples, THESIS_TAG, frequency_window_hz=100.0, operating_mode=NEVER)
    result = compare(pulses, truth, THESIS_TAG)
    assert result.matched == len(truth) == len(pulses)
    keys = [(pulse.group_sequence, pulse.group_index) for pulse in pulses]
    assert len(set(keys)) == len(keys)
    assert {sequence for sequence, _ in keys} == set(range(1, max(keys)[0] + 1))
    # The group after the first confirms; the first was told at once.
    assert all(pulse.confirmed for pulse in pulses if pulse.group_sequence >= 4)


def test_without_a_lock_no_pulse_is_looked_for_where_a_track_would_expect_it() -> None:
    truth, samples = sent(806, 60.0, lambda at_s: 20.0 if at_s < 12.0 else 7.0, offset_hz=300.0)
    late = {}
    for mode in (NEVER, SOFT):
        pulses, _ = detect(samples, THESIS_TAG, operating_mode=mode)
        assert compare(pulses, truth, THESIS_TAG).matched >= 9
        late[mode] = sum(start_s(pulse) > 14.0 for pulse in pulses)
    assert late[SOFT] > 2 * late[NEVER]


def test_without_a_lock_the_groups_of_another_tag_are_told_too() -> None:
    rng = np.random.default_rng(807)
    trains = [made.train(rng, 30.0, 18.0, offset_hz=offset_hz) for offset_hz in (100.0, 900.0)]
    samples = make_samples(rng, trains[0] + trains[1], duration_s=30.0)
    for mode, share in ((NEVER, 0.9), (SOFT, 0.0)):
        pulses, _ = detect(samples, THESIS_TAG, operating_mode=mode)
        assert compare(pulses, trains[0], THESIS_TAG).matched >= 0.9 * len(trains[0])
        others = [p for p in pulses if p.frequency_hz > THESIS_TAG.frequency_hz + 800.0]
        assert len(others) >= share * len(trains[1])
        assert mode is NEVER or len(others) <= 3


@pytest.mark.parametrize("mode", [SOFT, HARD, NEVER])
@pytest.mark.parametrize("rates_s", [(1.254,), (1.254, 2.0)])
def test_each_pulse_is_told_once_under_a_number_of_its_own(
    mode: OperatingMode, rates_s: tuple[float, ...]
) -> None:
    rng = np.random.default_rng(0)
    tag = replace(THESIS_TAG, pulse_intervals_s=rates_s)
    # So near to each other that without a lock they go on with each other's groups.
    trains = [
        made.train(rng, 50.0, 10.0, interval_s=1.27, offset_hz=50.0),
        made.train(rng, 50.0, 12.0, interval_s=1.3, offset_hz=-40.0),
    ]
    samples = make_samples(rng, trains[0] + trains[1], duration_s=50.0)
    pulses, _ = detect(samples, tag, frequency_window_hz=500.0, operating_mode=mode)
    assert len(pulses) > 25
    keys = [(pulse.rate, pulse.group_sequence, pulse.group_index) for pulse in pulses]
    assert len(set(keys)) == len(keys)
    starts_ns = sorted(pulse.start_time_ns for pulse in pulses)
    assert all(later - earlier > 15e6 for earlier, later in pairwise(starts_ns))
