from uavrt.mavlink import TimeSync

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
    local_ns = sync.local_ns(7 * SECOND)
    assert local_ns is not None
    assert 3_000_000 <= local_ns - START_NS < 3_200_000
