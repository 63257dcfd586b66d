"""The ground's link and the drone's exchange in the numbered versions, over a lossy radio."""

from collections.abc import Callable
from typing import Any

import pytest
from until import until_async as until

from uavrt.core.commands import Generation, SystemState
from uavrt.core.errors import CommandRefused, LinkError
from uavrt.core.messages import Command, Tag
from world import World


@pytest.mark.parametrize("generation", ["G1", "G2v1", "G2"])
async def test_the_ground_commands_a_drone_of_each_generation_over_a_lossy_radio(
    make_world: Callable[..., World], thesis_tag: Tag, generation: Generation
) -> None:
    world = make_world(mavlink={"tunnel_generation": generation, "tunnel_experimental": True})

    async def insist(step: Any) -> Any:
        """Four tries may all be lost; a person would press again."""
        while True:
            try:
                return await step()
            except LinkError:
                continue

    station = world.station(generation=generation, ack_wait_s=0.2)
    async with world.flying(), station as (ground, _):
        world.radio.loss = 0.2
        await insist(lambda: ground.upload_tags([thesis_tag]))
        directory = await insist(lambda: ground.start_detection(center_frequency_hz=148.7e6))
        assert "flight_log_" in directory
        await until(lambda: "receiver" in world.health)
        assert await insist(lambda: ground.ask("radio_status")) == "receiving"
        await insist(ground.stop_detection)
        await until(lambda: not world.mission.flights.ending)
        await insist(lambda: ground.command(ground.writing.start(148.7e6, 9, "raw_capture")))
        await insist(ground.stop_detection)
        await until(lambda: world.mission.state is SystemState.HAS_TAGS)
        await until(lambda: not world.mission.flights.ending)
        with pytest.raises(CommandRefused, match="again after 10 s to delete 1 flight:"):
            await insist(lambda: ground.ask("clean_logs"))
        with pytest.raises(CommandRefused, match="flash drive not found"):
            await insist(lambda: ground.ask("save_logs"))
        if generation == "G2":
            # What was repeated on the radio reached the supervisor once.
            await until(lambda: world.counter("commands") == len(world.of(Command)))
    assert world.of(Command)[0].name == "start_tags"
    assert world.mission.upload.tags == {thesis_tag.tag_id: thesis_tag}
    (capture, *_) = (c for c in world.of(Command) if c.name == "raw_capture")
    assert (capture.center_frequency_hz, capture.gain) == (148_700_000, 9)
