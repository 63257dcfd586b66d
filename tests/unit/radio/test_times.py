import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.radio.timing.sample_times import NominalTimes, TimeKeeper

RATE_HZ = 3_000_000.0
BLOCK = 262_200
START_NS = 1_700_000_000_000_000_000
DELAY_S = 0.004


def run(
    seconds: float,
    *,
    ppm: float,
    jitter_s: float,
    stalls: float,
    seed: int,
    lose_at_s: float | None = None,
    lose: int = 0,
) -> tuple[TimeKeeper, np.ndarray, list[int]]:
    """Feed a keeper as a radio would; return the errors of the times it gave [s]."""
    rng = np.random.default_rng(seed)
    keeper = TimeKeeper(RATE_HZ)
    true_rate = RATE_HZ * (1.0 + ppm * 1e-6)
    errors, gaps = [], []
    index = sampled = 0
    stalled_until = 0.0
    for _ in range(round(seconds * RATE_HZ / BLOCK)):
        if lose_at_s is not None and sampled >= lose_at_s * RATE_HZ:
            sampled, lose_at_s = sampled + lose, None
        begin_s = sampled / true_rate
        sampled += BLOCK
        arrival_s = sampled / true_rate + DELAY_S + rng.exponential(jitter_s)
        if rng.random() < stalls:
            stalled_until = arrival_s + rng.uniform(0.05, 0.4)
        arrival_s = max(arrival_s, stalled_until)
        keeper.arrived(index + BLOCK, START_NS + round(arrival_s * 1e9))
        lost = keeper.lost_samples()
        if lost:
            gaps.append(lost)
        index += lost
        errors.append((keeper.time_ns(index) - START_NS) / 1e9 - begin_s - DELAY_S)
        index += BLOCK
    return keeper, np.array(errors), gaps


@settings(max_examples=25)
@given(ppm=st.floats(-50, 50), jitter_s=st.floats(0.0, 0.005), seed=st.integers(0, 1000))
def test_times_follow_the_radio_through_jitter_stalls_and_a_wrong_crystal(
    ppm: float, jitter_s: float, seed: int
) -> None:
    keeper, errors, gaps = run(120, ppm=ppm, jitter_s=jitter_s, stalls=0.01, seed=seed)
    assert gaps == []
    # The first arrival may be late by a stall (0.4 s at most); the fast slew takes that out
    # at 1 ms a second, so the bound below is for starts that are late by their jitter.
    settled = errors[len(errors) // 2 :]
    if abs(errors[0]) < 0.02:
        assert np.abs(settled).max() < 0.002
    assert keeper.rate_error * 1e6 == pytest.approx(ppm, abs=8.0)


@settings(max_examples=15)
@given(ppm=st.floats(-50, 50), seed=st.integers(0, 1000))
def test_time_never_jumps_nor_runs_backwards(ppm: float, seed: int) -> None:
    _, errors, _ = run(40, ppm=ppm, jitter_s=0.005, stalls=0.02, seed=seed)
    block_s = BLOCK / RATE_HZ
    assert np.abs(np.diff(errors)).max() <= (1000e-6 + 60e-6 + 50e-6) * block_s + 1e-8


@settings(max_examples=15)
@given(lose=st.integers(100_000, 3_000_000), seed=st.integers(0, 1000))
def test_samples_lost_silently_become_a_gap_of_the_right_size(lose: int, seed: int) -> None:
    _, errors, gaps = run(
        60, ppm=5.0, jitter_s=0.001, stalls=0.0, seed=seed, lose_at_s=20.0, lose=lose
    )
    assert len(gaps) == 1
    assert gaps[0] == pytest.approx(lose, abs=0.002 * RATE_HZ)
    assert abs(errors[-1]) < 0.003


def test_a_slow_reader_is_not_taken_for_lost_samples() -> None:
    keeper = TimeKeeper(RATE_HZ)
    late_s = 0.0
    for block in range(1, 600):
        if 200 <= block < 260:
            late_s += 0.02
        elif late_s > 0.0:
            late_s = max(0.0, late_s - 0.01)
        arrival_s = block * BLOCK / RATE_HZ + late_s
        keeper.arrived(block * BLOCK, START_NS + round(arrival_s * 1e9))
        assert keeper.lost_samples() == 0


def test_the_rate_is_the_nominal_one_until_it_can_be_measured() -> None:
    keeper, _, _ = run(9, ppm=50.0, jitter_s=0.002, stalls=0.0, seed=1)
    assert keeper.sample_rate_hz == RATE_HZ


def test_a_replay_through_a_pipe_keeps_the_nominal_rate() -> None:
    keeper = TimeKeeper(RATE_HZ)
    for block in range(1, 400):
        # Forty times faster than the radio was.
        now_ns = START_NS + round(block * BLOCK / RATE_HZ / 40 * 1e9)
        keeper.arrived(block * BLOCK, now_ns, catching_up=True)
        assert keeper.lost_samples() == 0
    assert keeper.unseen is not None
    assert keeper.sample_rate_hz == RATE_HZ
    second_ns = keeper.time_ns(int(60 * RATE_HZ)) - keeper.time_ns(int(30 * RATE_HZ))
    assert second_ns == 30_000_000_000


def test_a_writer_that_waited_for_us_stamps_the_start_when_it_is_level() -> None:
    keeper = TimeKeeper(RATE_HZ)
    block_s = BLOCK / RATE_HZ
    for block in range(1, 100):
        # It has been sampling for 0.5 s before we read, and then writes without a pause.
        sampled_s = block * block_s
        arrival_s = max(sampled_s, 0.5 + block * 0.005)
        keeper.arrived(
            block * BLOCK, START_NS + round(arrival_s * 1e9), catching_up=arrival_s > sampled_s
        )
    error_s = (keeper.time_ns(99 * BLOCK) - START_NS) / 1e9 - 99 * block_s
    assert abs(error_s) < 1e-6


@given(index=st.integers(0, 2**50), rate=st.sampled_from([3e6, 250e3, 768e3, 2.4e6]))
def test_nominal_times_do_not_drift_however_long_the_recording(index: int, rate: float) -> None:
    times = NominalTimes(START_NS, rate)
    exact = START_NS + (index * 1_000_000_000 * 2 + int(rate)) // (2 * int(rate))
    assert times.time_ns(index) == exact


def test_a_time_before_the_first_arrival_is_refused() -> None:
    with pytest.raises(ValueError, match="arrived"):
        TimeKeeper(RATE_HZ).time_ns(0)
