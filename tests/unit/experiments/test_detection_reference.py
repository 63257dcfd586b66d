"""Ours against the original's statistic, on identical data."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from original_detector import Group, OriginalDetector
from some import some

from uavrt.detection.search.thresholds import decision_span_s
from uavrt_experiments.detection import original
from uavrt_experiments.detection.false_alarms import detected_groups
from uavrt_experiments.detection.interference import carrier, impulses
from uavrt_experiments.detection.signals import THESIS_TAG, TruePulse, noise
from uavrt_experiments.detection.trials import RATE_HZ, Decision, detect, group_found

LEVELS_DB = (8.5, 9.5, 10.5)
TRIALS = 20
"""Decisions for each level."""


@pytest.fixture(scope="module")
def the_original() -> OriginalDetector:
    return OriginalDetector(THESIS_TAG)


def reported_right(group: Group | None, truth: Sequence[TruePulse]) -> bool:
    """As `group_found`: frequency within 50 Hz, half of the pulses within 0.75 tp."""
    if group is None:
        return False
    placed = sum(
        min(abs(start - t.start_s) for t in truth) <= 0.75 * THESIS_TAG.pulse_width_s
        for start in group.starts_s
    )
    right = abs(group.offset_hz - truth[0].offset_hz) <= 50.0
    return right and 2 * placed >= len(group.starts_s)


def test_the_reference_has_the_originals_segment_and_threshold(
    the_original: OriginalDetector,
) -> None:
    """Location and scale of its Gumbel fit were measured on the original: 18.44 and 1.125."""
    assert (the_original.window, the_original.hop) == (75, 38)
    assert (the_original.error, the_original.jitter) == (6, 1)
    assert the_original.segment == 14819
    assert the_original.location == pytest.approx(18.44, abs=0.25)
    assert the_original.scale == pytest.approx(1.125, abs=0.12)


def test_the_reference_finds_a_pulse_where_it_is(the_original: OriginalDetector) -> None:
    samples, truth = Decision().stretch(np.random.default_rng(1), 25.0)
    group = some(the_original.detect(samples))
    assert reported_right(group, truth)
    assert abs(group.offset_hz - truth[0].offset_hz) <= 12.6


def test_ours_finds_more_groups_than_the_originals_statistic_in_the_same_samples(
    the_original: OriginalDetector,
) -> None:
    """Both at pf 1 %. An equal detector would pass with a chance below 0.1 % (sign test)."""
    only_ours = only_theirs = 0
    for level in LEVELS_DB:
        ours = theirs = 0
        for trial in range(TRIALS):
            rng = np.random.default_rng((21, round(10 * level), trial))
            samples, truth = Decision().stretch(rng, level)
            mine = group_found(detect(samples, THESIS_TAG)[0], truth, THESIS_TAG)
            other = reported_right(the_original.detect(samples), truth)
            ours, theirs = ours + mine, theirs + other
            only_ours += mine and not other
            only_theirs += other and not mine
        assert ours >= theirs, f"at {level} dB"
        # The reference is the original: its published Pd within 3.3 standard deviations.
        low, high = (original.PD[float(f(level))] for f in (math.floor, math.ceil))
        expected = 0.5 * (low + high)
        spread = math.sqrt(expected * (1.0 - expected) / TRIALS)
        assert theirs / TRIALS == pytest.approx(expected, abs=3.3 * spread)
    discordant = only_ours + only_theirs
    assert only_ours > 0.5 * discordant + 3.1 * 0.5 * math.sqrt(discordant)


def test_both_make_as_many_false_alarms_as_asked_for() -> None:
    """At 20 %: 60 stretches of noise make 12 ± 9.3 groups (three standard deviations)."""
    tag = replace(THESIS_TAG, false_alarm_probability=0.2)
    reference = OriginalDetector(tag, probability=0.2)
    count = round(decision_span_s(tag) * RATE_HZ)
    ours = theirs = 0
    for trial in range(60):
        samples = noise(np.random.default_rng((22, trial)), count)
        ours += detected_groups(detect(samples, tag)[0])[0]
        theirs += reference.detect(samples) is not None
    assert 3 <= ours <= 21
    assert 3 <= theirs <= 21


def spans(seed: int, kind: str) -> list[np.ndarray]:
    """Stretches with interference alone."""
    count = round(decision_span_s(THESIS_TAG) * RATE_HZ)
    made = []
    for trial in range(10):
        rng = np.random.default_rng((seed, trial))
        samples = noise(rng, count)
        if kind == "a carrier on a bin":
            samples += carrier(rng, count, offset_hz=50.0 * (trial + 3), level_db=30.0)
        else:
            samples += impulses(rng, count, per_s=2.0, level_db=30.0)
        made.append(samples)
    return made


@pytest.mark.parametrize("kind", ["a carrier on a bin", "impulses"])
def test_what_fools_the_originals_statistic_does_not_fool_ours(
    kind: str, the_original: OriginalDetector
) -> None:
    """At a nominal 1 % ten stretches hold 0.1 false groups; two have a chance of 0.5 %."""
    stretches = spans(23, kind)
    theirs = sum(the_original.detect(samples) is not None for samples in stretches)
    ours = sum(bool(detect(samples, THESIS_TAG)[0]) for samples in stretches)
    assert theirs >= 8
    assert ours <= 1
