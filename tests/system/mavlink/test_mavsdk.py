"""A ground station that nobody here wrote: MAVSDK, through the simulated autopilot."""

import asyncio
import json
import struct
from contextlib import aclosing

import pytest
from mavsdk.asyncio.mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.plugins.mavlink_direct import MavlinkMessage
from until import until_async as until

from uavrt.core.commands import SystemState
from uavrt.core.messages import Tag
from uavrt.link.tunnel.generations.codec import TunnelMessage, decode
from uavrt.link.tunnel.generations.g0 import SUCCESS, AckG0, PulseG0
from uavrt.link.tunnel.generations.g1 import AckG1, PulseG1
from world import World

START_TAGS, END_TAGS, STOP = (struct.pack("<I", number) for number in (2, 3, 6))
THESIS_TAG_G0 = bytes.fromhex(  # golden
    "04000000020000007022dd0814000000e6040000000000003c0000000a00000003000000000000007b14ae47"
    "e17a743f"
)
THESIS_TAG_G1 = struct.pack(
    "<9I4xdII4d", 4, 2, 148_710_000, 20, 1254, 0, 60, 10, 3, 0.005, 0, 0, *[float("nan")] * 4
)
SENT = {
    "G0": (THESIS_TAG_G0, END_TAGS, struct.pack("<I", 5)),
    "G1": (THESIS_TAG_G1, END_TAGS, struct.pack("<IIIIddI4x", 5, 0, 0, 0, 0.0, 0.0, 0)),
}


class MavsdkStation:
    """Sends and collects tunnel payloads with MAVSDK's own encoder and decoder."""

    def __init__(self, direct: MavlinkDirectAsync) -> None:
        self._direct = direct
        self.received: list[TunnelMessage] = []

    async def collect(self) -> None:
        async with aclosing(self._direct.subscribe_message("TUNNEL")) as messages:
            async for message in messages:
                fields = json.loads(message.fields_json)
                payload = bytes(fields["payload"])[: fields["payload_length"]]
                assert message.component_id == 191
                self.received.append(decode(payload))

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

    def acknowledgements(self) -> list[AckG0 | AckG1]:
        acks = [m for m in self.received if isinstance(m, AckG0 | AckG1)]
        assert all(ack.result == SUCCESS for ack in acks)
        return acks

    def pulses(self) -> list[PulseG0 | PulseG1]:
        """Pulses; search reports and a detector's heartbeats are left out."""
        found = [m for m in self.received if isinstance(m, PulseG0 | PulseG1)]
        return [one for one in found if one.detection_status < 3 and one.frequency_hz]


@pytest.mark.parametrize(
    ("numbers", "generation"), [((255, 190), "G0"), ((245, 190), "G0"), (None, "G1")]
)
async def test_mavsdk_uploads_the_thesis_tag_starts_receives_pulses_and_stops(
    world: World,
    thesis_tag: Tag,
    numbers: tuple[int, int] | None,
    generation: str,
) -> None:
    """At its default numbers where none are given."""
    if numbers is None:
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    else:
        configuration = Configuration.create_manual(*numbers, True)
    async with world.flying(), Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
        system = await mavsdk.first_autopilot(timeout_s=60.0)
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
        for count, payload in enumerate((START_TAGS, *SENT[generation]), start=1):
            await station.send(payload)
            await until(lambda n=count: len(station.acknowledgements()) == n)  # type: ignore[misc]
        acks = station.acknowledgements()
        assert [ack.acked_command for ack in acks] == [2, 4, 3, 5]
        # The first command does not show of which version its sender is.
        later = AckG0 if generation == "G0" else AckG1
        assert [type(ack) for ack in acks] == [AckG1, later, later, later]
        assert world.mission.upload.tags == {thesis_tag.tag_id: thesis_tag}
        assert world.mission.state.name == "DETECTING"
        for index in range(10):
            world.find_pulse(index)
        await until(lambda: len(station.pulses()) == 10)
        assert [p.frequency_hz for p in station.pulses()] == [
            148_710_000 + index for index in range(10)
        ]
        of_version = PulseG0 if generation == "G0" else PulseG1
        assert {type(pulse) for pulse in station.pulses()} == {of_version}
        await station.send(STOP)
        await until(lambda: station.acknowledgements()[-1].acked_command == 6)
        await until(lambda: world.mission.state is SystemState.HAS_TAGS)
        components = await system.component_ids()
        assert set(components) >= {1, 191}
        collector.cancel()
        await asyncio.gather(collector, return_exceptions=True)
        direct.destroy()
    configuration.destroy()
