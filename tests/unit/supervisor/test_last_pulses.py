"""A flight is closed when its last pulse has its pose, not before and not much later."""

import asyncio
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.drone.supervisor.mission.last_pulses import FOUND, POSED, LastPulses

LONG_S = 3600.0


def after(topics: Sequence[str]) -> LastPulses:
    last = LastPulses()
    last.flight_started()
    for topic in topics:
        last.passed(topic)
    return last


def posed_within(last: LastPulses, limit_s: float) -> bool:
    return asyncio.run(last.posed_within(limit_s))


@given(st.lists(st.sampled_from([FOUND, "recorded", "health", "poses"]), max_size=50))
def test_a_flight_may_be_closed_when_every_pulse_has_its_pose(passed: list[str]) -> None:
    pulses = passed.count(FOUND)
    assert posed_within(after(passed), 0.0) == (pulses == 0)
    if pulses:
        last = after([*passed, *[POSED] * (pulses - 1)])
        assert last.waiting == 1
        assert not posed_within(last, 0.0)
    assert posed_within(after([*passed, *[POSED] * pulses]), LONG_S)


def test_who_waits_goes_on_with_the_last_pulse() -> None:
    async def story() -> bool:
        last = after([FOUND, FOUND])
        waiting = asyncio.ensure_future(last.posed_within(LONG_S))
        for topic in ("recorded", "health", POSED, POSED):
            await asyncio.sleep(0)
            assert not waiting.done()
            last.passed(topic)
        async with asyncio.timeout(30.0):
            return await waiting

    assert asyncio.run(story())


@pytest.mark.parametrize("stragglers", [0, 1, 3])
def test_what_an_earlier_flight_lost_or_brings_late_does_not_count(stragglers: int) -> None:
    last = after([FOUND] * 3)
    last.flight_started()
    for _ in range(stragglers):
        last.passed(POSED)
    assert posed_within(last, 0.0)
    last.passed(FOUND)
    assert not posed_within(last, 0.0)
    last.passed(POSED)
    assert posed_within(last, 0.0)
