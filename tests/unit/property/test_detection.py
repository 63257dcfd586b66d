"""Properties of the detector: what must hold for any blocks, times and amplitudes."""

import itertools
from dataclasses import replace

import made
import numpy as np
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from uavrt.core.messages import Pulse
from uavrt.detection.search.anchors import AnchorSearch
from uavrt.detection.search.grid import make_grid, sliding_maximum
from uavrt.detection.search.hypotheses import interval_grid, jitter_reach
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples, noise

RATE_HZ = 3750.0


def run(samples: np.ndarray, cuts: list[int], start_ns: int = START_NS) -> list[Pulse]:
    detector = made.detector(THESIS_TAG, RATE_HZ)
    pulses: list[Pulse] = []
    edges = [0, *sorted(cut % len(samples) for cut in cuts), len(samples)]
    for first, last in itertools.pairwise(edges):
        time_ns = start_ns + round(first / RATE_HZ * 1e9)
        pulses += detector.process(samples[first:last], time_ns)
    return pulses + detector.flush()


@settings(max_examples=6)
@given(cuts=st.lists(st.integers(0, 10**6), min_size=0, max_size=60))
def test_the_pulses_do_not_depend_on_how_the_stream_is_cut(cuts: list[int]) -> None:
    rng = np.random.default_rng(1)
    truth = made.train(rng, 8.0, 17.0, offset_hz=80.0)
    samples = make_samples(rng, truth, duration_s=8.0)
    whole = sorted(p.start_time_ns for p in run(samples, []))
    parts = sorted(p.start_time_ns for p in run(samples, cuts))
    assert len(whole) == len(parts) == len(truth)
    assert all(abs(a - b) < 1_000_000 for a, b in zip(whole, parts, strict=True))


@settings(max_examples=8)
@given(
    sizes=st.lists(st.integers(1, round(0.1 * RATE_HZ)), min_size=1, max_size=40),
    tag_id=st.integers(1, 2000),
)
def test_a_pulse_is_told_half_a_second_after_its_end_whatever_the_blocks(
    sizes: list[int], tag_id: int
) -> None:
    rng = np.random.default_rng(4)
    truth = made.train(rng, 8.0, 20.0, offset_hz=80.0)
    samples = make_samples(rng, truth, duration_s=8.0)
    detector = made.detector(replace(THESIS_TAG, tag_id=tag_id), RATE_HZ)
    position, told = 0, 0
    for size in itertools.cycle(sizes):
        if position >= len(samples):
            break
        block = samples[position : position + size]
        found = detector.process(block, START_NS + round(position / RATE_HZ * 1e9))
        position += len(block)
        now_ns = START_NS + round(position / RATE_HZ * 1e9)
        told += len(found)
        group_ns = max((p.end_time_ns for p in found), default=now_ns)
        assert now_ns - group_ns <= 500_000_000
    assert told >= len(truth) - 1


def test_the_tags_of_a_flight_are_all_searched_at_the_same_block() -> None:
    block = noise(np.random.default_rng(5), round(0.0874 * RATE_HZ))
    detectors = [
        made.detector(replace(THESIS_TAG, tag_id=2 * number), RATE_HZ)
        for number in range(1, 21)
    ]
    searched = []
    for number in range(20):
        time_ns = START_NS + round(number * len(block) / RATE_HZ * 1e9)
        before = [detector._clean for detector in detectors]
        for detector in detectors:
            detector.process(block, time_ns)
        after = [detector._clean for detector in detectors]
        searched.append(sum(a > b for a, b in zip(after, before, strict=True)))
    # One block in five: what the tags share is done once for all.
    assert set(searched) == {0, 20}
    assert 3 <= searched.count(20) <= 5


@settings(max_examples=5)
@given(exponent=st.integers(-6, 6))
def test_the_pulses_do_not_depend_on_the_gain(exponent: int) -> None:
    rng = np.random.default_rng(2)
    truth = made.train(rng, 6.0, 17.0, offset_hz=80.0)
    samples = make_samples(rng, truth, duration_s=6.0)
    scaled = samples * np.float32(10.0**exponent)
    plain, loud = run(samples, []), run(scaled, [])
    assert [p.start_time_ns for p in plain] == [p.start_time_ns for p in loud]
    assert all(abs(a.snr_db - b.snr_db) < 0.05 for a, b in zip(plain, loud, strict=True))


@settings(max_examples=10)
@given(
    times=st.lists(st.integers(-(10**13), 10**13), min_size=1, max_size=12),
    sizes=st.lists(st.integers(0, 3000), min_size=12, max_size=12),
)
def test_no_order_of_times_makes_it_fail(times: list[int], sizes: list[int]) -> None:
    rng = np.random.default_rng(3)
    detector = made.detector(THESIS_TAG, RATE_HZ)
    for time_ns, size in zip(times, sizes, strict=False):
        detector.process(noise(rng, size), START_NS + time_ns)
    later_ns = START_NS + 2 * 10**13
    samples = make_samples(rng, made.train(rng, 6.0, 17.0), duration_s=6.0)
    found = detector.process(samples, later_ns) + detector.flush()
    assert [pulse for pulse in found if pulse.start_time_ns >= later_ns]


@given(reach=st.integers(1, 20), columns=st.integers(45, 80), seed=st.integers(0, 2**32 - 1))
def test_the_sliding_maximum_is_the_maximum_over_the_window(
    reach: int, columns: int, seed: int
) -> None:
    power = np.random.default_rng(seed).random((columns, 3), dtype=np.float32)
    slow = [power[i : i + 2 * reach + 1].max(axis=0) for i in range(columns - 2 * reach)]
    for either_order in (power, np.ascontiguousarray(power.T).T):
        assert np.array_equal(sliding_maximum(either_order, reach), np.array(slow))


@settings(max_examples=5)
@given(seed=st.integers(0, 2**32 - 1), k=st.sampled_from([2, 3, 4]), sent=st.booleans())
@example(seed=1, k=4, sent=True)
@example(seed=1, k=4, sent=False)
def test_pruned_search_finds_the_best_that_testing_every_anchor_finds(
    seed: int, k: int, sent: bool
) -> None:
    rng = np.random.default_rng(seed)
    power = rng.exponential(size=(240, 3)).astype(np.float32)
    hop_s, interval_s, uncertainty_s, jitter_s = 0.0024, 0.15, 0.012, 0.005
    threshold = 5.0 * k
    if sent:
        power[np.rint(20 + np.arange(k) * interval_s / hop_s).astype(int), 1] += 6.0
    search = AnchorSearch(
        rows=3,
        hop_s=hop_s,
        interval_s=interval_s,
        uncertainty_s=uncertainty_s,
        jitter_s=jitter_s,
        k=k,
        threshold=threshold,
        rate=1,
    )
    level = np.ones(3, np.float32)
    found = search.push(power[:100], level) + search.push(power[100:], level)
    found += search.finish(level)
    reach = jitter_reach(jitter_s, hop_s)
    intervals = interval_grid(
        interval_s=interval_s, uncertainty_s=uncertainty_s, hop_s=hop_s, k=k, reach=reach
    )
    padded = np.pad(power, ((300, 300), (0, 0)))
    largest = np.max([np.roll(padded, s, axis=0) for s in range(-reach, reach + 1)], axis=0)
    cells, limited = np.minimum(padded, 14.0), np.minimum(largest, 14.0)
    best = 0.0
    # By definition an anchor is a peak of the mean of a group at the threshold or more; from a
    # weaker one other jitters could be reached.
    anchor = (padded == largest) & (padded >= threshold / k)
    for column in range(300, 540):
        for place in range(k):
            for interval in intervals:
                at = [
                    column + int(np.rint((j - place) * interval))
                    for j in range(k)
                    if j != place
                ]
                total = cells[column] + limited[at].sum(axis=0)
                best = max(best, float(total[anchor[column]].max(initial=0.0)))
    assume(abs(best - threshold) > 1e-3)
    assert bool(found) == (best > threshold)
    assert found or not sent
    if found:
        assert abs(max(c.score for c in found) * threshold - best) < 1e-3


@given(
    sample_rate_hz=st.floats(3000.0, 12_000.0),
    width_s=st.floats(0.010, 0.040),
    window_hz=st.floats(50.0, 1400.0),
    offset_hz=st.floats(-500.0, 500.0),
)
def test_a_tone_in_the_window_has_its_power_at_its_row_at_any_rate(
    sample_rate_hz: float, width_s: float, window_hz: float, offset_hz: float
) -> None:
    grid = make_grid(
        sample_rate_hz=sample_rate_hz,
        pulse_width_s=width_s,
        offset_hz=offset_hz,
        half_width_hz=window_hz,
    )
    assert abs(grid.hop_s - width_s / 8.0) < 0.35 * width_s / 8.0
    step_hz = float(np.diff(grid.offsets_hz).mean())
    assert abs(step_hz * width_s - 0.25) < 0.02
