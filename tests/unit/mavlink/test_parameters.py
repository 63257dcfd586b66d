"""Our parameters and metadata, read and set by programs that nobody here wrote."""

import asyncio
import struct
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from until import until_async as until

from uavrt.config.parameters import OFFERED, RUN, parameter_values
from uavrt.core.messages import CommandReply
from uavrt.link.mavlink.dialect import MavParamType
from uavrt.link.mavlink.services.parameter_service import decode_value, encode_value
from world import World


def values_of(world: World) -> dict[str, float]:
    return {**parameter_values(world.mission.settings.now), RUN.name: 0.0}


def ready(world: World) -> bool:
    """Whether the connection knows its autopilot."""
    return "connection" in world.health and world.health["connection"].status == "ready"


class PymavlinkStation(asyncio.DatagramProtocol):
    """A ground station of pymavlink's encoder and decoder."""

    def __init__(self) -> None:
        from pymavlink.dialects.v20 import ardupilotmega

        self.dialect = ardupilotmega
        self.mav = ardupilotmega.MAVLink(None, srcSystem=255, srcComponent=190)
        self.heard: list[Any] = []
        """Values of component 191 since `say`, as pymavlink understands bytewise encoding."""
        self.texts: list[str] = []
        self.vehicle: Any = None
        self._transport: Any = None

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.vehicle = addr
        for message in self.mav.parse_buffer(data) or []:
            if message.get_srcComponent() != 191:
                continue
            if message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)
            if message.get_type() == "PARAM_VALUE":
                raw = struct.pack("<f", message.param_value)
                whole = message.param_type == self.dialect.MAV_PARAM_TYPE_INT32
                value = struct.unpack("<i" if whole else "<f", raw)[0]
                self.heard.append((message.param_id, value, message.param_index))

    async def say(self, *messages: Any) -> dict[str, float]:
        """Send; get the values that are told then."""
        self.heard.clear()
        for message in messages:
            self._transport.sendto(message.pack(self.mav), self.vehicle)
        await asyncio.sleep(2.0)
        return {name: value for name, value, _ in self.heard}


async def test_pymavlink_sets_a_parameter_bytewise_and_hears_why_not(
    make_world: Callable[..., World], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    world = make_world(mavlink={"commanders": (255,)})
    station = PymavlinkStation()
    mav, say = station.mav, station.say
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: station, local_addr=("127.0.0.1", world.ground_port)
    )
    async with world.flying():
        await until(lambda: station.vehicle is not None)
        await say(mav.heartbeat_encode(6, 8, 0, 0, 4))
        await until(lambda: ready(world))
        listed = await say(mav.param_request_list_encode(1, 0))
        assert listed == pytest.approx(values_of(world))
        assert [index for _, _, index in station.heard] == list(range(len(OFFERED)))
        assert await say(mav.param_request_read_encode(1, 191, b"DET_K", -1)) == {"DET_K": 0}
        assert await say(mav.param_request_read_encode(1, 191, b"", 0)) == {"RADIO_GAIN": -1}
        unknown = mav.param_request_read_encode(1, 191, b"SYSID_THISMAV", -1)
        assert await say(unknown, mav.param_request_read_encode(1, 191, b"", 99)) == {}
        twelve, forty = (struct.unpack("<f", struct.pack("<i", value))[0] for value in (12, 40))
        set_to_twelve = mav.param_set_encode(1, 191, b"RADIO_GAIN", twelve, 6)
        assert await say(set_to_twelve) == {"RADIO_GAIN": 12}
        set_to_forty = mav.param_set_encode(1, 191, b"RADIO_GAIN", forty, 6)
        assert await say(set_to_forty) == {"RADIO_GAIN": 12}
        assert station.texts[-1] == "RADIO_GAIN cannot be 40: whole, 0 to 21, or -1"
        mav.srcSystem = 253  # one that may not command
        set_window = mav.param_set_encode(1, 191, b"DET_WINDOW_HZ", float("nan"), 9)
        values = await say(mav.heartbeat_encode(6, 8, 0, 0, 4), set_to_twelve, set_window)
        assert values == {"RADIO_GAIN": 12, "DET_WINDOW_HZ": 500}
        assert "may not command" in station.texts[-1]
        assert len(world.of(CommandReply)) == 2
    transport.close()


@given(st.integers(-(2**22), 2**23), st.booleans())
def test_a_whole_number_comes_back_in_either_encoding(value: int, bytewise: bool) -> None:
    field = encode_value(float(value), MavParamType.INT32, bytewise)
    wire = struct.unpack("<f", struct.pack("<f", field))[0]
    assert decode_value(wire, MavParamType.INT32, bytewise) == value


@pytest.mark.parametrize("kind", [MavParamType.INT64, MavParamType.REAL64, 77])
def test_a_type_that_does_not_fit_the_field_is_no_value(kind: int) -> None:
    assert decode_value(1.0, kind, bytewise=True) is None
