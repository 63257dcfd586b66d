"""The parts are joined: what a drone finds is at the ground, and an order is flown."""

import asyncio
from pathlib import Path

import pytest
from attacked import key_file

from uavrt.core.commands import SystemState
from uavrt.core.messages import PulsePose
from uavrt.link.tunnel.own_messages.seal import read_key
from world import THESIS_TAG, World, until


async def test_pulses_reach_the_ground_over_a_bad_radio(tmp_path: Path) -> None:
    world = World(tmp_path)
    async with world.flying(), world.station() as (link, events):
        await link.upload_tags([THESIS_TAG])
        await link.start_detection()
        assert world.mission.state is SystemState.DETECTING
        world.radio.loss = 0.2
        for number in range(30):
            world.find_pulse(number)
            await asyncio.sleep(0.2)
        await until(lambda: len([e for e in events if isinstance(e, PulsePose)]) >= 30)
        world.radio.loss = 0.0
        await link.stop_detection()
        await until(lambda: world.mission.state is SystemState.HAS_TAGS)


@pytest.mark.parametrize("silent_s", [0.0, 5.0], ids=["at once", "after the drone"])
async def test_the_session_is_announced_under_the_autopilot_s_number_alone(
    tmp_path: Path, silent_s: float
) -> None:
    key = key_file(tmp_path)
    world = World(tmp_path, system_id=4, mavlink={"key_file": str(key)})
    start_ns = world.clock.now_ns()
    restarts = [(at_s, world.restart_autopilot) for at_s in (0.0, 1.4, 2.8, 4.2) if silent_s]
    async with world.flying(restarts), world.station(key=read_key(key)) as (link, _):
        assert world.clock.now_ns() - start_ns >= silent_s * 1e9
        await link.upload_tags([THESIS_TAG])
        assert link.protocol.counters["bad_payloads"] == 0
