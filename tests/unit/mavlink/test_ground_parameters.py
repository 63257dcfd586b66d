"""Our ground station lists and sets the drone's parameters; with a key, sealed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from until import until_async as until

from uavrt.config.parameters import RUN, parameter_values
from uavrt.core.errors import CommandRefused, LinkError, TunnelError
from uavrt.core.messages import StatusText
from uavrt.link.tunnel.own_messages.seal import parameter_content, read_key, read_parameter
from world import World


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_parameters_are_listed_and_set_over_a_lossy_radio(
    world: World, flavour: str
) -> None:
    station = world.station(ack_wait_s=0.4)
    async with world.flying(flavour=flavour), station as (ground, events):
        world.radio.loss = 0.15
        listed: dict[str, float] = {}
        for _ in range(10):
            try:
                listed = await ground.parameters.list_all()
                break
            except LinkError:
                continue
        assert listed == {**parameter_values(world.mission.settings.now), RUN.name: 0.0}
        assert await ground.parameters.set("RADIO_GAIN", 15) == 15
        assert await ground.parameters.set("DET_FALSE_ALARM", 0.005) == pytest.approx(0.005)
        with pytest.raises(CommandRefused, match="is still 15"):
            await ground.parameters.set("RADIO_GAIN", 40)
        assert world.mission.settings.now.radio.gain == 15
        world.radio.loss = 0.0
        await until(
            lambda: any(
                isinstance(one, StatusText) and "RADIO_GAIN cannot be 40" in one.text
                for one in events
            )
        )


async def test_a_drone_with_a_key_takes_only_sealed_parameters(
    make_world: Callable[..., World], tmp_path: Path
) -> None:
    path = tmp_path / "key"
    path.write_text("5a" * 32)
    path.chmod(0o600)
    world = make_world(mavlink={"key_file": str(path)})
    async with world.flying():
        async with world.station(ack_wait_s=0.4) as (stranger, _):
            with pytest.raises(CommandRefused, match="is still -1"):
                await stranger.parameters.set("RADIO_GAIN", 15)
            assert "only accepts sealed" in world.of(StatusText)[-1].text
        async with world.station(key=read_key(path)) as (friend, _):
            with pytest.raises(LinkError, match="no session for sealed"):
                friend.protocol.sealed_parameter("RADIO_GAIN", 15.0)
            sealed: list[Any] = []

            def heard_session() -> bool:
                try:
                    sealed.append(friend.protocol.sealed_parameter("RADIO_GAIN", 15.0))
                except LinkError:
                    return False
                return True

            await until(heard_session)
            friend.send(sealed[0])
            await until(lambda: world.mission.settings.now.radio.gain == 15)
            friend.send(sealed[0])  # overheard and repeated
            await until(lambda: world.counter("seals_refused") == 1)


def test_the_inside_of_a_sealed_parameter_has_twenty_bytes() -> None:
    assert read_parameter(parameter_content("DET_FALSE_ALARM", 0.5)) == ("DET_FALSE_ALARM", 0.5)
    assert len(parameter_content("A" * 16, 1.0)) == 20
    with pytest.raises(TunnelError, match="20 bytes"):
        read_parameter(b"short")
