"""A ground station that nobody here wrote: MAVSDK, through the simulated autopilot."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from contextlib import aclosing

import pytest
from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.plugins.mavlink_direct import MavlinkMessage

from uavrt import tunnel
from uavrt.messages import SystemState, Tag
from world import World

Until = Callable[..., Awaitable[None]]


class MavsdkStation:
    """Sends and collects tunnel payloads with MAVSDK's own encoder and decoder."""

    def __init__(self, direct: MavlinkDirectAsync) -> None:
        self._direct = direct
        self.received: list[tunnel.TunnelMessage] = []

    async def collect(self) -> None:
        async with aclosing(self._direct.subscribe_message("TUNNEL")) as messages:
            async for message in messages:
                fields = json.loads(message.fields_json)
                payload = bytes(fields["payload"])[: fields["payload_length"]]
                assert message.component_id == 191
                self.received.append(tunnel.decode(payload))

    async def send(self, payload: bytes) -> None:
        fields = {
            "target_system": 1,
            "target_component": 191,
            "payload_type": 0,
            "payload_length": len(payload),
            "payload": list(payload.ljust(128, b"\0")),
        }
        message = MavlinkMessage(
            message_name="TUNNEL",
            target_system_id=1,
            target_component_id=191,
            fields_json=json.dumps(fields),
        )
        await self._direct.send_message(message)

    def acknowledged(self) -> list[int]:
        acks = [m for m in self.received if isinstance(m, tunnel.AckG0 | tunnel.AckG1)]
        assert all(ack.result == tunnel.SUCCESS for ack in acks)
        return [ack.acked_command for ack in acks]

    def pulses(self) -> list[tunnel.PulseG0 | tunnel.PulseG1]:
        return [m for m in self.received if isinstance(m, tunnel.PulseG0 | tunnel.PulseG1)]


@pytest.mark.parametrize("numbers", [(255, 190), (245, 190)])
async def test_mavsdk_uploads_the_thesis_tag_and_receives_pulses(
    world: World,
    thesis_tag: Tag,
    until: Until,
    numbers: tuple[int, int],
) -> None:
    commands = [
        tunnel.HeaderMessage(command=tunnel.CommandId.START_TAGS).encode(),
        tunnel.tag_to_wire(thesis_tag, "G0").encode(),
        tunnel.HeaderMessage(command=tunnel.CommandId.END_TAGS).encode(),
        tunnel.HeaderMessage(command=tunnel.CommandId.START_DETECTION).encode(),
    ]
    configuration = Configuration.create_manual(*numbers, True)
    async with world.flying(), Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
        system = await mavsdk.first_autopilot(timeout_s=20.0)
        assert system is not None
        await until(
            lambda: (
                "connection" in world.health and world.health["connection"].status == "ready"
            )
        )
        direct = MavlinkDirectAsync(system)
        station = MavsdkStation(direct)
        collector = asyncio.create_task(station.collect())
        await asyncio.sleep(0)
        for count, payload in enumerate(commands, start=1):
            await station.send(payload)
            await until(lambda count=count: len(station.acknowledged()) == count)
        assert station.acknowledged() == [2, 4, 3, 5]
        assert world.mission.tags == {thesis_tag.tag_id: thesis_tag}
        assert world.mission.state is SystemState.DETECTING
        for index in range(10):
            world.find_pulse(index)
        await until(lambda: len(station.pulses()) == 10)
        assert [p.frequency_hz for p in station.pulses()] == [
            148_710_000 + index for index in range(10)
        ]
        components = await system.component_ids()
        assert set(components) >= {1, 191}
        collector.cancel()
        await asyncio.gather(collector, return_exceptions=True)
        direct.destroy()
    configuration.destroy()
