"""The parts are joined: what a drone finds is at the ground, and an order is flown."""

import asyncio
from pathlib import Path

from uavrt.core.commands import SystemState
from uavrt.core.messages import PulsePose
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
