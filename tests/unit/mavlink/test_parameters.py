"""Our parameters, read and set by pymavlink and by our own ground station."""

import asyncio
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from stock_station import StockStation, bytewise, stock_station
from until import until_async as until

from uavrt.config.parameters import OFFERED, RUN, parameter_values
from uavrt.core.errors import CommandRefused, LinkError, TunnelError
from uavrt.core.messages import CommandReply, StatusText
from uavrt.link.mavlink.dialect import MavParamType
from uavrt.link.mavlink.services.parameter_service import decode_value, encode_value
from uavrt.link.tunnel.own_messages.seal import parameter_content, read_key, read_parameter
from world import World


def values_of(world: World) -> dict[str, float]:
    return {**parameter_values(world.mission.settings.now), RUN.name: 0.0}


def ready(world: World) -> bool:
    """Whether the connection knows its autopilot."""
    return "connection" in world.health and world.health["connection"].status == "ready"


async def answers(station: StockStation, *messages: Any) -> dict[str, float]:
    """Send; get the values that are told then."""
    before = len(station.heard)
    for message in messages:
        station.say(message)
    await asyncio.sleep(2.0)
    return dict(station.values(before))


async def test_pymavlink_sets_a_parameter_bytewise_and_hears_why_not(
    make_world: Callable[..., World], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    world = make_world(mavlink={"commanders": (255,)})
    known = partial(ready, world)
    async with world.flying(), stock_station(world.ground_port, known) as station:
        mav, say = station.mav, partial(answers, station)
        listed = await say(mav.param_request_list_encode(1, 0))
        assert listed == pytest.approx(values_of(world))
        told = station.of("PARAM_VALUE")
        assert [one.param_index for one in told] == list(range(len(OFFERED)))
        assert await say(mav.param_request_read_encode(1, 191, b"DET_K", -1)) == {"DET_K": 0}
        assert await say(mav.param_request_read_encode(1, 191, b"", 0)) == {"RADIO_GAIN": -1}
        unknown = mav.param_request_read_encode(1, 191, b"SYSID_THISMAV", -1)
        assert await say(unknown, mav.param_request_read_encode(1, 191, b"", 99)) == {}
        set_to_twelve = mav.param_set_encode(1, 191, b"RADIO_GAIN", bytewise(12), 6)
        set_to_forty = mav.param_set_encode(1, 191, b"RADIO_GAIN", bytewise(40), 6)
        assert await say(set_to_twelve) == {"RADIO_GAIN": 12}
        assert await say(set_to_forty) == {"RADIO_GAIN": 12}
        assert station.texts[-1] == "RADIO_GAIN cannot be 40: whole, 0 to 21, or -1"
        mav.srcSystem = 253  # one that may not command
        set_window = mav.param_set_encode(1, 191, b"DET_WINDOW_HZ", float("nan"), 9)
        values = await say(mav.heartbeat_encode(6, 8, 0, 0, 4), set_to_twelve, set_window)
        assert values == {"RADIO_GAIN": 12, "DET_WINDOW_HZ": 500}
        assert "may not command" in station.texts[-1]
        assert len(world.of(CommandReply)) == 2


@given(st.integers(-(2**22), 2**23), st.booleans())
def test_a_whole_number_comes_back_in_either_encoding(value: int, bytewise: bool) -> None:
    field = encode_value(float(value), MavParamType.INT32, bytewise)
    wire = struct.unpack("<f", struct.pack("<f", field))[0]
    assert decode_value(wire, MavParamType.INT32, bytewise) == value


@pytest.mark.parametrize("kind", [MavParamType.INT64, MavParamType.REAL64, 77])
def test_a_type_that_does_not_fit_the_field_is_no_value(kind: int) -> None:
    assert decode_value(1.0, kind, bytewise=True) is None


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_parameters_are_set_over_a_lossy_radio(world: World, flavour: str) -> None:
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
