"""Radio and Wi-Fi at once: each pulse once, and a cut is bridged within two seconds."""

import asyncio
from typing import Any

from delivered import numbers
from hypothesis import given
from hypothesis import strategies as st
from until import until_async as until

from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.sending.routes import FRESH_NS, STEADY_NS, Routes

Bay = Any  # tests/unit/processes/conftest.py
STATION = Peer(254, 190)
SECOND = 10**9


async def test_pulses_go_by_wifi_or_when_it_is_cut_by_radio_each_once(
    two_link_bay: Bay,
) -> None:
    bay = two_link_bay
    async with (
        bay.relay.running() as wifi,
        bay.running(),
        bay.ground_station(f"udpout://127.0.0.1:{wifi.port}") as (_, events),
    ):
        sent = 0

        async def send(count: int) -> None:
            nonlocal sent
            for _ in range(count):
                bay.send_pulse(sent)
                sent += 1
            await until(lambda: len(numbers(events)) == sent)

        await until(lambda: bay.process._link.tunnel.link == 1)
        await send(20)
        passed_by_radio = bay.autopilot.counters()["forwarded_to_ground"]
        wifi.cut = True
        bay.send_pulse(sent)
        sent += 1
        await until(lambda: len(numbers(events)) == sent)
        assert bay.process._link.tunnel.link == 0
        await send(20)
        assert bay.autopilot.counters()["forwarded_to_ground"] > passed_by_radio + 20
        wifi.cut = False
        await until(lambda: bay.process._link.tunnel.link == 1)
        await send(5)
        assert sorted(numbers(events)) == list(range(sent))
        assert bay.process._link.tunnel.changes == 3


async def test_a_command_is_answered_by_the_link_that_it_came_by(two_link_bay: Bay) -> None:
    bay = two_link_bay
    async with (
        bay.relay.running() as wifi,
        bay.running(),
        bay.ground_station(f"udpout://127.0.0.1:{wifi.port}") as (by_wifi, _),
    ):
        await until(lambda: bay.process._link.tunnel.link == 1)
        before = bay.autopilot.counters()["forwarded_to_ground"]
        await by_wifi.stop_detection()
        by_radio = by_wifi._links
        by_radio.best = lambda: [1, 0]  # as if Wi-Fi were silent
        await by_wifi.stop_detection()
        await until(lambda: len(bay.commands) == 2)
        assert bay.process._inbox.stations._asked_on == {(254, 190): 0}
        assert bay.autopilot.counters()["forwarded_to_ground"] > before


async def test_a_second_station_on_the_radio_alone_gets_each_pulse(two_link_bay: Bay) -> None:
    bay = two_link_bay
    async with (
        bay.relay.running() as wifi,
        bay.running(),
        bay.ground_station() as (_, by_radio),
        bay.ground_station(f"udpout://127.0.0.1:{wifi.port}", radio=False, system_id=245) as (
            _,
            by_wifi,
        ),
    ):
        await until(lambda: len(bay.process._link.tunnel._links) == 2)
        for number in range(30):
            bay.send_pulse(number)
        await until(lambda: len(numbers(by_wifi)) == len(numbers(by_radio)) == 30)
        await asyncio.sleep(0.5)
        assert sorted(numbers(by_wifi)) == sorted(numbers(by_radio)) == list(range(30))


@given(
    phase_ns=st.integers(0, SECOND - 1),
    cut_ns=st.integers(5 * SECOND, 8 * SECOND),
    jitter=st.lists(st.integers(0, 100_000_000), min_size=20, max_size=20),
)
def test_after_any_cut_the_radio_is_taken_within_one_and_a_half_seconds(
    phase_ns: int, cut_ns: int, jitter: list[int]
) -> None:
    routes = Routes(2)
    beats = [(second * SECOND + phase_ns + jitter[second]) for second in range(20)]
    heard = sorted(
        [(at_ns, 1) for at_ns in beats if at_ns < cut_ns] + [(at_ns, 0) for at_ns in beats]
    )
    changed_ns = None
    for now_ns in range(0, 15 * SECOND, 50_000_000):
        while heard and heard[0][0] <= now_ns:
            at_ns, link = heard.pop(0)
            routes.received(STATION, link, at_ns)
        link = routes.link_to(STATION, now_ns)
        if 4 * SECOND < now_ns < cut_ns:
            assert link == 1
        elif now_ns > cut_ns and link == 0 and changed_ns is None:
            changed_ns = now_ns
    assert changed_ns is not None
    assert changed_ns - cut_ns <= FRESH_NS + 50_000_000


def test_a_link_that_comes_and_goes_is_not_taken_again_until_it_is_steady() -> None:
    routes = Routes(2)
    for tenth in range(300):
        now_ns = tenth * SECOND // 10
        routes.received(STATION, 0, now_ns)
        if tenth % 25 < 8:  # 0.8 s of Wi-Fi in every 2.5 s
            routes.received(STATION, 1, now_ns)
        if now_ns > STEADY_NS:
            assert routes.link_to(STATION, now_ns) == 0


def test_a_link_on_which_nothing_is_answered_is_left_for_a_while() -> None:
    routes = Routes(2)
    for second in range(30):
        for link in (0, 1):
            routes.received(STATION, link, second * SECOND)
        if second == 10:
            assert routes.link_to(STATION, second * SECOND) == 1
            routes.doubt(1, second * SECOND)
        if 10 <= second < 20:
            assert routes.link_to(STATION, second * SECOND) == 0
    assert routes.link_to(STATION, 29 * SECOND) == 1


def test_when_all_links_are_silent_the_one_heard_last_is_used() -> None:
    routes = Routes(3)
    routes.received(STATION, 1, 1 * SECOND)
    routes.received(STATION, 2, 3 * SECOND)
    routes.received(STATION, 0, 2 * SECOND)
    assert routes.link_to(STATION, 60 * SECOND) == 2
    assert routes.links_to([], 60 * SECOND) == ()
