"""Which bursts are a tag's beat: rates in a small ratio, and pulses that are only lost."""

from itertools import product

import numpy as np
import pytest
from depth import share
from numpy.typing import NDArray

from uavrt.detection.beeps.beats import FoundBeat, find_beats
from uavrt.detection.beeps.chains import chain_with_switches

RATIOS = [(1.333, 2.0), (1.0, 1.5), (1.2, 1.8), (1.0, 2.0), (0.75, 1.5), (1.5, 2.0), (1.0, 3.0)]


def times_of(
    rng: np.random.Generator, intervals_s: tuple[float, ...], switches_s: tuple[float, ...]
) -> NDArray[np.float64]:
    """Pulses of a minute, the next interval from each switch on, ± 5 ms."""
    times, at_s = [], 0.5
    while at_s < 59.9:
        times.append(at_s)
        past = sum(at_s >= switch_s for switch_s in switches_s)
        at_s += intervals_s[past % len(intervals_s)]
    return np.array(times) + rng.uniform(-0.005, 0.005, len(times))


def stretches(found: list[FoundBeat], times_s: NDArray[np.float64]) -> list[tuple[float, ...]]:
    """Interval, first and last pulse of each beat, in order of time."""
    return sorted(
        (times_s[one.members[0]], times_s[one.members[-1]], one.beat.interval_s)
        for one in found
    )


@pytest.mark.parametrize(("ratio", "turned"), share([*product(RATIOS, (False, True))], 3))
def test_rates_in_a_small_ratio_are_two_beats_one_after_the_other(
    ratio: tuple[float, float], turned: bool
) -> None:
    first_s, second_s = reversed(ratio) if turned else ratio
    for seed in range(3):
        rng = np.random.default_rng(seed)
        heard = times_of(rng, (first_s, second_s), (30.0,))
        heard = heard[rng.random(heard.size) > 0.03]
        times_s = np.sort(np.concatenate((heard, rng.uniform(0.0, 60.0, 2))))
        before, after = stretches(find_beats(times_s, 60.0), times_s)
        assert abs(before[2] - first_s) < 2e-3
        assert abs(after[2] - second_s) < 2e-3
        # With the pulse at the switch lost, the place that both share may go with either.
        assert abs(before[1] - 30.0) < 4.0 * max(ratio)
        assert abs(after[0] - 30.0) < 4.0 * max(ratio)


@pytest.mark.parametrize("ratio", [(1.333, 2.0), (2.0, 1.333), (1.0, 2.0), (1.5, 0.75)])
def test_a_tag_that_switches_and_switches_back_has_three_stretches(
    ratio: tuple[float, float],
) -> None:
    times_s = times_of(np.random.default_rng(1), ratio, (20.0, 40.0))
    intervals_s = [one[2] for one in stretches(find_beats(times_s, 60.0), times_s)]
    assert intervals_s == pytest.approx([ratio[0], ratio[1], ratio[0]], abs=3e-3)


@pytest.mark.parametrize("lost", [0.1, 0.2, 0.3])
def test_pulses_lost_at_random_make_no_second_rate(lost: float) -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        times_s = times_of(rng, (1.254,), ())
        times_s = times_s[rng.random(times_s.size) >= lost]
        (one,) = find_beats(times_s, 60.0)
        assert abs(one.beat.interval_s - 1.254) < 2e-3
        assert one.members.size >= 0.95 * times_s.size


@pytest.mark.parametrize(("first", "count"), [(3, 4), (20, 4), (20, 6), (-8, 4)])
def test_every_second_pulse_lost_for_a_while_is_no_second_rate(first: int, count: int) -> None:
    times_s = times_of(np.random.default_rng(2), (1.0,), ())
    times_s = np.delete(times_s, first % times_s.size + 2 * np.arange(count))
    (one,) = find_beats(times_s, 60.0)
    assert abs(one.beat.interval_s - 1.0) < 1e-3
    assert one.members.size == times_s.size


def test_a_tag_that_fades_out_and_comes_back_keeps_its_interval() -> None:
    rng = np.random.default_rng(3)
    times_s = times_of(rng, (1.254,), ())
    loss = np.clip(1.2 - np.abs(times_s - 30.0) / 12.0, 0.0, 1.0)
    times_s = times_s[rng.random(times_s.size) >= loss]
    found = find_beats(times_s, 60.0)
    assert all(abs(one.beat.interval_s - 1.254) < 5e-3 for one in found)
    assert sum(one.members.size for one in found) >= times_s.size - 2


def test_two_tags_at_one_frequency_stay_two_beats_of_the_whole_minute() -> None:
    rng = np.random.default_rng(4)
    first, second = times_of(rng, (1.0,), ()), times_of(rng, (1.7,), ()) + 0.31
    times_s = np.sort(np.concatenate((first, second)))
    found = find_beats(times_s, 61.0)
    assert sorted(round(one.beat.interval_s, 2) for one in found) == [1.0, 1.7]
    assert all(np.ptp(times_s[one.members]) > 50.0 for one in found)


def test_a_chain_changes_its_interval_where_the_tag_did() -> None:
    times_s = np.concatenate((np.arange(10) * 1.0, 9.0 + 1.5 * np.arange(1, 9)))
    merit, parts = chain_with_switches(times_s, 1.0, 1.5)
    assert merit == times_s.size - 2.0
    assert [(rate, where.tolist()) for rate, where in parts] == [
        (0, list(range(10))),
        (1, list(range(9, 18))),
    ]
