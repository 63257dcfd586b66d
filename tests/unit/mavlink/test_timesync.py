import random

import pytest
from some import some

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
def test_a_simulated_px4_that_runs_slow_is_followed_from_the_third_second(
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
