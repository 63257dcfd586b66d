"""The autopilot's clock on a busy computer: a steady skew is no restart, a step is one."""

import random

import pytest

from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.autopilot.timesync import TimeSync

SKEWS_PPM = (0.0, 50.0, 11_800.0, -11_800.0, 20_000.0, -20_000.0)


def way_s(rng: random.Random) -> float:
    """One way of a message: now and then a process waits for its turn."""
    late_s = 0.0003 + rng.expovariate(500.0)
    if rng.random() < 0.15:
        late_s += rng.expovariate(16.0)
    if rng.random() < 0.03:
        late_s += rng.uniform(0.1, 0.8)
    return late_s


def resets_s(
    skew_ppm: float, seed: int, *, lasts_s: float, step_s: float = 0.0, stalls_s: float = 0.0
) -> list[float]:
    """Times of resets [s]; the clock steps at half of the time, and stalls each second."""
    rng, sync, found = random.Random(seed), TimeSync(), []
    time_s = stalled_s = 0.0
    while time_s < lasts_s:
        wait_s = 0.1 if time_s < 2.0 else 1.0
        time_s += wait_s
        stalled_s += rng.uniform(0.5, 1.5) * stalls_s * wait_s
        there_s = time_s + way_s(rng)
        boot_s = 1000.0 + there_s * (1.0 - skew_ppm * 1e-6) - stalled_s
        boot_s += step_s if there_s > lasts_s / 2.0 else 0.0
        before = sync.resets
        sync.add_round_trip(
            ns_from_s(time_s), ns_from_s(boot_s), ns_from_s(there_s + way_s(rng))
        )
        found += [time_s] * (sync.resets - before)
    return found


@pytest.mark.parametrize("skew_ppm", SKEWS_PPM)
def test_a_steady_skew_is_no_restart(skew_ppm: float) -> None:
    assert not [one for seed in range(30) for one in resets_s(skew_ppm, seed, lasts_s=200.0)]


def test_a_simulation_that_falls_behind_a_little_each_second_is_no_restart() -> None:
    """PX4's simulated clock stands while the computer is busy: 12 ms in each second."""
    seeds = range(30)
    assert not [one for k in seeds for one in resets_s(0.0, k, lasts_s=200.0, stalls_s=0.012)]


@pytest.mark.parametrize("skew_ppm", SKEWS_PPM)
@pytest.mark.parametrize("step_s", [-0.1, 0.1, 0.3, 5.0, -2000.0])
def test_a_step_is_noticed_within_five_seconds(skew_ppm: float, step_s: float) -> None:
    for seed in range(20):
        found = resets_s(skew_ppm, seed, lasts_s=120.0, step_s=step_s)
        assert found
        assert 60.0 <= found[0] <= 65.0
