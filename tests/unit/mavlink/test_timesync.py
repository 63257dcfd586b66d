import random

import pytest
from some import some

from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.autopilot.timesync import TimeSync

START_NS = 1_700_000_000 * 10**9
SECOND = 10**9


def feed(sync: TimeSync, start_ns: int, boot_start_ns: int, seconds: int) -> None:
    for second in range(seconds):
        sent_ns = start_ns + second * SECOND
        sync.add_round_trip(sent_ns, boot_start_ns + second * SECOND + 500_000, sent_ns + 10**6)


def test_nothing_is_known_before_the_first_answer() -> None:
    assert TimeSync().local_ns(0) is None


def test_one_answer_is_enough_for_a_first_offset() -> None:
    sync = TimeSync()
    feed(sync, START_NS, 5 * SECOND, 1)
    assert sync.local_ns(5 * SECOND) == START_NS
    assert sync.round_trip_s == 0.001


def test_a_crystal_that_is_off_is_measured() -> None:
    sync = TimeSync()
    for second in range(20):
        sent_ns = START_NS + second * SECOND
        boot_ns = round((second * SECOND + 500_000) * (1 - 50e-6))
        sync.add_round_trip(sent_ns, boot_ns, sent_ns + 1_000_000)
    assert abs(sync.skew_ppm - 50.0) < 0.5


def test_a_restarted_autopilot_is_believed_at_once() -> None:
    sync = TimeSync()
    feed(sync, START_NS, 1000 * SECOND, 20)
    later_ns = START_NS + 25 * SECOND
    feed(sync, later_ns, 2 * SECOND, 1)
    assert sync.local_ns(2 * SECOND) == later_ns
    assert sync.resets == 1


def test_a_slow_clock_is_right_from_its_restart_on_over_a_slow_link() -> None:
    sync = TimeSync()
    rng = random.Random(5)
    rate = 1 - 0.015

    def answer(now_ns: int, boot_at_ns: int) -> None:
        way_s, back_s = (0.01 + rng.expovariate(50.0) for _ in range(2))
        boot_ns = round((now_ns + way_s * SECOND - boot_at_ns) * rate)
        sync.add_round_trip(now_ns, boot_ns, round(now_ns + (way_s + back_s) * SECOND))

    for second in range(30):
        answer(START_NS + second * SECOND, START_NS - 1000 * SECOND)
    boot_at_ns = START_NS + 30 * SECOND
    errors_s = []
    for tenth in range(1, 35):
        now_ns = boot_at_ns + tenth * SECOND // 10
        answer(now_ns, boot_at_ns)
        local_ns = some(sync.local_ns(round((now_ns - boot_at_ns) * rate)))
        errors_s.append((local_ns - now_ns) / SECOND)
    assert sync.resets == 1
    assert max(map(abs, errors_s[5:])) < 0.02  # 0.05 s, when the skew is forgotten


def test_one_slow_answer_is_no_restart_and_moves_nothing() -> None:
    sync = TimeSync()
    feed(sync, START_NS, 1000 * SECOND, 20)
    before = sync.local_ns(1020 * SECOND)
    sent_ns = START_NS + 20 * SECOND
    # The answer left at once but took 900 ms to come: the midpoint is 450 ms off.
    sync.add_round_trip(sent_ns, 1020 * SECOND, sent_ns + 900_000_000)
    after = sync.local_ns(1020 * SECOND)
    assert sync.resets == 0
    assert before is not None
    assert after is not None
    assert abs(after - before) < 200_000


def test_an_autopilot_that_answers_no_timesync_serves_by_its_least_delay() -> None:
    sync = TimeSync()
    for step in range(200):
        boot_ns = 7 * SECOND + step * 20_000_000
        delay_ns = 3_000_000 + (step * 7919) % 5_000_000
        sync.add_one_way(boot_ns, START_NS + step * 20_000_000 + delay_ns)
        if step < 100:
            assert sync.local_ns(boot_ns) is None
    local_ns = some(sync.local_ns(7 * SECOND))
    assert 3_000_000 <= local_ns - START_NS < 3_200_000


@pytest.mark.parametrize("skew", [-0.015, 0.015])
@pytest.mark.parametrize("jitter_s", [0.001, 0.004])
def test_a_slow_simulated_px4_is_followed_from_second_three(
    skew: float, jitter_s: float
) -> None:
    draw = random.Random(5)
    sync = TimeSync()
    worst_s = 0.0
    sent_ns = START_NS

    def boot_ns(local_ns: int) -> int:
        return 20 * SECOND + round((local_ns - START_NS) * (1.0 + skew))

    for step in range(60):
        there_ns, back_ns = (round(draw.expovariate(1.0 / jitter_s) * 1e9) for _ in range(2))
        arrived_ns = sent_ns + there_ns
        sync.add_round_trip(sent_ns, boot_ns(arrived_ns), arrived_ns + back_ns)
        sent_ns += SECOND // 10 if step < 20 else SECOND
        if sent_ns - START_NS > 3 * SECOND:
            for ahead_ns in (0, SECOND // 2):
                local_ns = some(sync.local_ns(boot_ns(sent_ns + ahead_ns)))
                worst_s = max(worst_s, abs(local_ns - sent_ns - ahead_ns) / SECOND)
    assert sync.resets == 0
    assert worst_s < 2.0 * jitter_s + 0.001
    assert some(sync.residual_s) < 2.0 * jitter_s


def test_the_bound_of_one_way_messages_ages_with_a_clock_that_runs_slow() -> None:
    draw = random.Random(3)
    sync = TimeSync()
    for step in range(50 * 120):
        local_ns = START_NS + step * SECOND // 50
        boot_ns = 7 * SECOND + round((local_ns - START_NS) * 0.985)
        sync.add_one_way(boot_ns, local_ns + round(draw.expovariate(1000.0) * 1e9))
        if step > 50 * 5:
            mapped_ns = some(sync.local_ns(boot_ns))
            # Never bound by an offset of two minutes ago, which is 1.8 s off by now.
            assert abs(mapped_ns - local_ns) < 0.02 * SECOND


def test_a_line_is_stale_ten_seconds_after_its_last_answer() -> None:
    sync = TimeSync()
    assert sync.is_stale(START_NS)
    feed(sync, START_NS, 5 * SECOND, 5)
    last_ns = START_NS + 4 * SECOND
    assert not sync.is_stale(last_ns + 9 * SECOND)
    assert sync.is_stale(last_ns + 11 * SECOND)
    assert sync.age_ns(last_ns + 11 * SECOND) == pytest.approx(11 * SECOND, abs=SECOND // 100)


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
    assert not [one for seed in range(15) for one in resets_s(skew_ppm, seed, lasts_s=200.0)]


def test_a_simulation_that_falls_behind_a_little_each_second_is_no_restart() -> None:
    """PX4's simulated clock stands while the computer is busy: 12 ms in each second."""
    seeds = range(30)
    assert not [one for k in seeds for one in resets_s(0.0, k, lasts_s=200.0, stalls_s=0.012)]


@pytest.mark.parametrize("skew_ppm", SKEWS_PPM)
@pytest.mark.parametrize("step_s", [-0.1, 0.1, 0.3, 5.0, -2000.0])
def test_a_step_is_noticed_within_five_seconds(skew_ppm: float, step_s: float) -> None:
    for seed in range(10):
        found = resets_s(skew_ppm, seed, lasts_s=120.0, step_s=step_s)
        assert found
        assert 60.0 <= found[0] <= 65.0
