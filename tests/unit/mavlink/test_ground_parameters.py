"""Our ground station lists and sets the drone's parameters; with a key, sealed."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from sealed import introduce

from uavrt.clock import Clock
from uavrt.config.parameters import RUN, parameter_values
from uavrt.config.settings import RecordingSettings, Settings
from uavrt.errors import CommandRefused, LinkError, TunnelError
from uavrt.ground.link.drone_link import GroundLink
from uavrt.mavlink import Connection, Handlers, Peer, Priority
from uavrt.mavlink.dialect import MavParamType, ParamSet
from uavrt.mavlink.parameters import Requests
from uavrt.processes.parameter_desk import ParameterDesk
from uavrt.supervisor.mission.orders import Mission
from uavrt.supervisor.mission.saved_state import StateStore
from uavrt.tunnel.gate import Gate
from uavrt.tunnel.private import SEALED_TYPE, SESSION_TYPE
from uavrt.tunnel.seal import (
    PARAMETER_INSIDE,
    Key,
    parameter_inside,
    parameter_of,
    read_key,
)

World = Any  # tests/unit/mavlink/conftest.py


class GatedDrone:
    """Connection, gate, desk and mission as the drone has them."""

    def __init__(self, clock: Clock, directory: Path, key_file: Path | None) -> None:
        self._clock = clock
        self._number = 0
        self.gate = Gate((), None if key_file is None else str(key_file))
        self.texts: list[str] = []
        self.connection = Connection(
            Handlers(
                attitude=lambda _: None,
                position=lambda _: None,
                tunnel=lambda _payload, _peer: None,
                private=self._private,
                parameters=lambda request, peer: self._take(request, peer, sealed=False),
            ),
            clock.now_ns,
        )
        self.mission = Mission(
            Settings(recording=RecordingSettings(directory=str(directory))),
            StateStore(directory),
            tell=lambda _severity, _text: None,
            on_start=lambda _flight: None,
            on_stop=lambda: None,
            on_settings=lambda changed: self._desk.changed(changed),
        )
        self._desk = ParameterDesk(
            self.mission.settings,
            lambda: self.connection.component.parameters_bytewise,
            send=lambda value, _asker: self.connection.tunnel.send_message(value),
            ask=lambda command: self._desk.reply(self.mission.command(command)),
            tell=lambda text: self.texts.append(text.text),
        )

    async def tick(self) -> None:
        while True:
            session = self.gate.announcement(self.connection.place)
            if session is not None:
                self.connection.tunnel.send_tunnel(
                    session, Priority.STATUS, payload_type=SESSION_TYPE
                )
            await asyncio.sleep(0.3)

    def _private(self, payload_type: int, payload: bytes, peer: Peer) -> None:
        if payload_type != SEALED_TYPE:
            return
        place = (peer.system_id, peer.component_id)
        opened = self.gate.open(payload, place, self.connection.place)
        if opened is not None and opened[0] == PARAMETER_INSIDE:
            name, value = parameter_of(opened[1])
            wish = ParamSet(
                target_system=0,
                target_component=0,
                param_id=name,
                param_value=value,
                param_type=MavParamType.REAL32,
            )
            self._take(wish, peer, sealed=True)

    def _take(self, request: Requests, peer: Peer, *, sealed: bool) -> None:
        self._number += 1
        refusal = self.gate.refusal((peer.system_id, peer.component_id), sealed=sealed)
        self._desk.receive(request, peer, refusal, self._number)


@asynccontextmanager
async def ground_of(
    world: World, key: Key | None = None, **flying: Any
) -> AsyncIterator[GroundLink]:
    ground = GroundLink(world.clock.now_ns, ack_wait_s=0.4, key=key)
    async with world.flying(**flying):
        task = asyncio.create_task(ground.run(world.ground_address))
        await ground.wait_for_drone(30.0)
        try:
            yield ground
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_parameters_are_listed_and_set_over_a_lossy_radio(
    world: World, tmp_path: Path, flavour: str
) -> None:
    drone = world.drone = GatedDrone(world.clock, tmp_path, None)

    async def main() -> None:
        async with ground_of(world, flavour=flavour, ground_loss=0.15, seed=2) as ground:
            listed: dict[str, float] = {}
            for _ in range(10):
                try:
                    listed = await ground.parameters.list_all()
                    break
                except LinkError:
                    continue
            assert listed == {**parameter_values(drone.mission.settings), RUN.name: 0.0}
            assert await ground.parameters.set("RADIO_GAIN", 15) == 15
            assert await ground.parameters.set("DET_FALSE_ALARM", 0.005) == pytest.approx(0.005)
            with pytest.raises(CommandRefused, match="stays 15"):
                await ground.parameters.set("RADIO_GAIN", 40)
        assert drone.mission.settings.radio.gain == 15
        assert "RADIO_GAIN cannot be 40" in drone.texts[-1]

    asyncio.run(main())


def test_a_drone_with_a_key_takes_only_sealed_parameters(world: World, tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("5a" * 32)
    path.chmod(0o600)
    drone = world.drone = GatedDrone(world.clock, tmp_path, path)

    async def main() -> None:
        async with ground_of(world) as stranger:
            with pytest.raises(CommandRefused, match="stays -1"):
                await stranger.parameters.set("RADIO_GAIN", 15)
            assert "only sealed" in drone.texts[-1]
            friend = GroundLink(world.clock.now_ns, key=read_key(path))
            friend.protocol.drone = stranger.protocol.drone
            with pytest.raises(LinkError, match="what to seal commands for"):
                friend.protocol.sealed_parameter("RADIO_GAIN", 15.0)
            place = drone.connection.place
            assert friend.protocol._sealer is not None
            introduce(friend.protocol._sealer, drone.gate, (254, 190), place)
            sealed = friend.protocol.sealed_parameter("RADIO_GAIN", 15.0)
            assert sealed is not None
            stranger.send(sealed)
            async with asyncio.timeout(20.0):
                while drone.mission.settings.radio.gain != 15:  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            stranger.send(sealed)  # overheard and repeated
            async with asyncio.timeout(20.0):
                while drone.gate.refused == 0:  # noqa: ASYNC110
                    await asyncio.sleep(0.01)

    asyncio.run(main())


def test_the_inside_of_a_sealed_parameter_has_twenty_bytes() -> None:
    assert parameter_of(parameter_inside("DET_FALSE_ALARM", 0.5)) == ("DET_FALSE_ALARM", 0.5)
    assert len(parameter_inside("A" * 16, 1.0)) == 20
    with pytest.raises(TunnelError, match="20 bytes"):
        parameter_of(b"short")
