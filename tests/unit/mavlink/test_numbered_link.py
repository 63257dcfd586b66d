"""The ground's link and the drone's exchange in the numbered versions, over a lossy radio."""

import asyncio
from typing import Any

import pytest

from uavrt.errors import CommandRefused, LinkError
from uavrt.ground.link.drone_link import GroundEvent, GroundLink
from uavrt.mavlink import Connection, Handlers, Peer, Priority
from uavrt.messages import Command, CommandReply, Tag
from uavrt.tunnel import Generation
from uavrt.tunnel.exchange import Answer, Exchange

World = Any  # tests/unit/mavlink/conftest.py


class NumberedDrone:
    """A connection with the real exchange; its supervisor refuses to save."""

    def __init__(self, world: World, generation: Generation) -> None:
        self.commands: list[Command] = []
        self.exchange = Exchange(generation, experimental=True)
        self.connection = Connection(
            Handlers(attitude=lambda _: None, position=lambda _: None, tunnel=self._tunnel),
            world.clock.now_ns,
        )

    async def tick(self) -> None:
        await asyncio.Event().wait()

    def _tunnel(self, payload: bytes, peer: Peer) -> None:
        result = self.exchange.receive(payload, (peer.system_id, peer.component_id))
        if isinstance(result, Command):
            self.commands.append(result)
            accepted = result.name != "save_logs"
            reply = CommandReply(
                request_id=result.request_id,
                name=result.name,
                accepted=accepted,
                message="flight_log_x" if accepted else "flash drive not found",
            )
            result = self.exchange.reply(reply)
        if isinstance(result, Answer):
            self.connection.tunnel.send_tunnel(result.payload, Priority.ACK, peer)


@pytest.mark.parametrize("generation", ["G1", "G2v1", "G2"])
def test_the_ground_commands_a_drone_of_each_generation_over_a_lossy_radio(
    world: World, thesis_tag: Tag, generation: Generation
) -> None:
    drone = world.drone = NumberedDrone(world, generation)
    tags = [thesis_tag]

    async def insist(step: Any) -> Any:
        """Four tries may all be lost; a person would press again."""
        while True:
            try:
                return await step()
            except LinkError:
                continue

    async def main() -> None:
        events: list[GroundEvent] = []
        ground = GroundLink(
            world.clock.now_ns, generation=generation, ack_wait_s=0.2, on_event=events.append
        )
        async with world.flying(ground_loss=0.2, seed=5):
            task = asyncio.create_task(ground.run(world.ground_address))
            await ground.wait_for_drone(30.0)
            await insist(lambda: ground.upload_tags(tags))
            directory = await insist(
                lambda: ground.start_detection(center_frequency_hz=148.7e6)
            )
            assert directory == "flight_log_x"
            await insist(ground.stop_detection)
            await insist(lambda: ground.capture(center_frequency_hz=148.7e6, gain=9))
            await insist(lambda: ground.ask("radio_status"))
            await insist(lambda: ground.ask("clean_logs"))
            with pytest.raises(CommandRefused, match="flash drive not found"):
                await insist(lambda: ground.ask("save_logs"))
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        names = [command.name for command in drone.commands]
        for name in ("start_tags", "add_tag", "end_tags", "start_detection", "radio_status"):
            assert name in names
        (added,) = {c.tag for c in drone.commands if c.tag is not None}
        assert added == thesis_tag
        (capture, *_) = (c for c in drone.commands if c.name == "raw_capture")
        assert (capture.center_frequency_hz, capture.gain) == (148_700_000, 9)
        if generation == "G2":
            # What was repeated on the radio reached the supervisor once.
            asked = drone.exchange.counters["commands"]
            assert asked == len(drone.commands)

    asyncio.run(main())
