"""A stream slower than real time is a slow source; a loss is a step."""

from typing import Any

import numpy as np
import pytest

from uavrt.analysis.measure.recorded_pulses import DetectionSummary
from uavrt.core.messages import IQBlock
from uavrt.radio.live_source import LiveSource
from uavrt.radio.receivers.radio_program import ProgramSource
from uavrt.radio.sample_stream import StreamSource
from uavrt.radio.timing.sample_placing import Placer

START_NS = 1_700_000_000_000_000_000
RATE_HZ = 250_000.0
WRITE_S = 0.02


def placed(
    speed: float,
    *,
    duration_s: float = 30.0,
    jitter_s: float = 0.0005,
    write_s: float = WRITE_S,
    seed: int = 0,
    fast_until_s: float = 0.0,
    stall_share: float = 0.0,
    loss_s: float = 0.0,
    loss_share: float = 0.0,
    radio: bool = False,
) -> tuple[Placer, list[IQBlock]]:
    """Place the blocks of a stream whose writer is steadily slower than the sample rate.

    `stall_share`: writes after which the computer stalls for up to 0.3 s. `loss_share`: writes
    before which `loss_s` are lost.
    """
    rng = np.random.default_rng(seed)
    placer = Placer(RATE_HZ, may_be_slow=not radio)
    placer.begin(START_NS)
    held, blocks, count = 0, [], round(write_s * RATE_HZ)
    now_s = lost_s = 0.0
    for number in range(1, round(duration_s / write_s) + 1):
        slow_s = max(number * write_s - fast_until_s, 0.0)
        due_s = number * write_s - slow_s + slow_s / speed
        lost_s += loss_s * (rng.random() < loss_share)
        now_s = max(now_s, due_s + lost_s + rng.exponential(jitter_s))
        now_s += rng.uniform(0.02, 0.3) * (rng.random() < stall_share)
        held += count
        placer.arrived(held, START_NS + round(now_s * 1e9))
        while held and placer.settle() and held >= 0.08 * RATE_HZ:
            block = placer.place(np.zeros(placer.cut or held, np.complex64))
            held -= len(block.samples)
            blocks.append(block)
    return placer, blocks


@pytest.mark.parametrize("speed", [0.3, 0.6, 0.8, 0.9])
@pytest.mark.parametrize("jitter_s", [0.0003, 0.002])
@pytest.mark.parametrize("write_s", [0.005, 0.02, 0.06])
def test_a_steady_shortfall_loses_nothing_and_keeps_the_distance_of_samples(
    speed: float, jitter_s: float, write_s: float
) -> None:
    placer, blocks = placed(speed, jitter_s=jitter_s, write_s=write_s, seed=3)
    assert placer.lost == 0
    first, last = blocks[0], blocks[-1]
    true_s = (last.sample_index - first.sample_index) / RATE_HZ
    assert (last.time_ns - first.time_ns) * 1e-9 == pytest.approx(true_s, abs=0.02)
    assert "slower" in str(placer.unseen)


@pytest.mark.parametrize("speed", [0.995, 0.97, 0.95, 0.93])
@pytest.mark.parametrize(("jitter_s", "stall_share"), [(0.0005, 0.0), (0.004, 0.02)])
def test_a_small_shortfall_is_known_within_15_s_also_on_a_busy_computer(
    speed: float, jitter_s: float, stall_share: float
) -> None:
    for seed in range(3):
        placer, blocks = placed(
            speed, duration_s=15.0, jitter_s=jitter_s, stall_share=stall_share, seed=seed
        )
        assert "slower" in str(placer.unseen)
        assert placer.withdrawn == placer.lost == sum(block.lost_before for block in blocks)
        assert placer.lost <= 1.1 * (1.0 / speed - 1.0) * 10.0 * RATE_HZ


@pytest.mark.parametrize(
    ("loss_s", "loss_share"), [(0.005, 0.02), (0.005, 0.2), (0.02, 0.05), (0.1, 0.03)]
)
def test_losses_of_a_radio_in_a_pipe_are_counted(loss_s: float, loss_share: float) -> None:
    busy: dict[str, Any] = {"duration_s": 20.0, "jitter_s": 0.002, "stall_share": 0.01}
    expected = loss_s * loss_share * 20.0 / WRITE_S * RATE_HZ
    for seed in range(2):
        placer, _ = placed(1.0, **busy, loss_s=loss_s, loss_share=loss_share, seed=seed)
        assert placer.unseen is None
        assert placer.lost == pytest.approx(expected, rel=0.4)


def test_the_summary_of_a_slow_source_counts_no_loss() -> None:
    summary = DetectionSummary(samples=1000, samples_lost=60, samples_unsure=40, signal_s=11.0)
    summary.withdraw(90, 100.0)
    assert (summary.samples_lost, summary.samples_unsure) == (10, 0)
    assert summary.signal_s == pytest.approx(10.1)


def test_a_source_that_becomes_slow_is_known_within_six_seconds() -> None:
    placer, _ = placed(0.85, duration_s=19.0, fast_until_s=12.0)
    assert "slower" in str(placer.unseen)
    assert placer.lost <= (1.0 / 0.85 - 1.0) * 6.0 * RATE_HZ


def test_a_steady_radio_is_no_slow_source() -> None:
    for seed in range(3):
        placer, _ = placed(1.0 - 50e-6, duration_s=60.0, jitter_s=0.002, seed=seed)
        assert placer.lost == 0
        assert placer.unseen is None


@pytest.mark.parametrize("speed", [0.8, 0.9])
def test_a_radio_that_is_read_directly_is_never_slow_but_loses_samples(speed: float) -> None:
    """On the drone times must stay with the poses, however evenly samples are lost."""
    placer, blocks = placed(speed, radio=True)
    assert placer.unseen is None
    assert placer.withdrawn == 0
    last, true_s = blocks[-1], 30.0 / speed
    assert placer.lost == pytest.approx((1.0 / speed - 1.0) * 30.0 * RATE_HZ, rel=0.1)
    assert (last.time_ns - START_NS) * 1e-9 == pytest.approx(true_s, abs=0.5)


def test_only_pipes_may_be_slow() -> None:
    assert StreamSource.MAY_BE_SLOW
    assert not ProgramSource.MAY_BE_SLOW
    assert not LiveSource.MAY_BE_SLOW
