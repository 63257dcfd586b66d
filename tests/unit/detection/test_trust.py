"""How long a track is believed that nothing confirms any more."""

import math
from dataclasses import replace

import numpy as np
import pytest

from uavrt.detection.search.refine import Measured
from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.tuning import FOLLOW
from uavrt_experiments.detection.signals import THESIS_TAG, noise
from uavrt_experiments.detection.trials import detect

VOLUME = 21.0
"""Cells of the window in which the fourth pulse of a group is expected."""
EMPTY = 4.0
"""The largest of so many, on the average."""


def measured(power: float) -> Measured:
    return Measured(start=0.0, offset_hz=0.0, power=power, noise=1.0, contrast=10.0)


def begun(power: float) -> Track:
    """A track that has just begun with three pulses of a power."""
    track = Track(tag=THESIS_TAG, rate=1, offset_hz=0.0, score=1.0)
    track.begin([(n, 1.254 * n, round(1.254e9 * n), measured(power)) for n in range(3)])
    return track


def step(track: Track, power: float) -> Slot:
    """Show a track what was found at its next place."""
    time_s = track.expected()[0]
    slot = Slot(0, time_s, round(time_s * 1e9), measured(power), VOLUME)
    track.step(slot)
    return slot


def empty_places(track: Track) -> int:
    """How many empty places end it."""
    places = 0
    while not track.dead:
        step(track, EMPTY)
        places += 1
    return places


def test_a_track_that_one_peak_confirmed_ends_after_three_empty_places() -> None:
    track = begun(9.0)
    step(track, 12.6)
    assert track.confirmed
    assert empty_places(track) <= 4


@pytest.mark.parametrize(
    ("power", "later"), [(9.0, [14.0] * 6), (30.0, [])], ids=["many pulses", "strong group"]
)
def test_a_track_of_many_clear_pulses_or_a_strong_group_outlives_ten_empty_places(
    power: float, later: list[float]
) -> None:
    track = begun(power)
    for one in later:
        step(track, one)
    assert track.confirmed
    assert empty_places(track) == FOLLOW.most_missed + 1


def test_the_peaks_that_began_a_track_do_not_vouch_for_weaker_ones() -> None:
    track = begun(10.0)
    step(track, 12.6)
    assert track.confirmed
    assert step(track, 6.0).state != "accepted"


def test_a_weak_pulse_of_a_trusted_track_is_vouched_for() -> None:
    track = begun(10.0)
    for _ in range(6):
        step(track, 13.0)
    assert step(track, 6.5).state == "accepted"


@pytest.mark.parametrize("seed", range(3))
def test_of_twenty_groups_of_noise_none_is_confirmed(seed: int) -> None:
    samples = noise(np.random.default_rng([73, seed]), round(60.0 * 3750.0))
    tag = replace(THESIS_TAG, false_alarm_probability=0.99)
    pulses, detector = detect(samples, tag, frequency_window_hz=math.inf)
    assert detector.counters.tracks >= 6
    assert not any(pulse.confirmed for pulse in pulses)
