"""Our parameters and metadata, read and set by programs that nobody here wrote."""

import asyncio
import contextlib
import json
import re
import struct
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mavproxy import mavproxy
from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.component_metadata import MetadataType
from mavsdk.plugins.param import ParamError, ProtocolVersion

from uavrt.config.parameters import OFFERED, RUN, parameter_values
from uavrt.mavlink.dialect import MavParamType
from uavrt.mavlink.parameters import decode_value, encode_value
from uavrt.messages import CommandReply
from world import World

Until = Callable[..., Awaitable[None]]


def values_of(world: World) -> dict[str, float]:
    return {**parameter_values(world.mission.settings), RUN.name: 0.0}


def ready(world: World) -> bool:
    """Whether the connection knows its autopilot."""
    return "connection" in world.health and world.health["connection"].status == "ready"


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_mavsdk_lists_sets_and_reads_our_parameters(
    world: World, until: Until, flavour: str
) -> None:
    async def main() -> None:
        configuration = Configuration.create_manual(255, 190, True)
        async with world.flying(flavour=flavour), Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
            system = await mavsdk.first_autopilot(timeout_s=20.0)
            await until(lambda: ready(world))
            param = ParamAsync(system)
            with contextlib.suppress(ParamError):  # answers UNKNOWN, and does it
                await param.select_component(191, ProtocolVersion.V1)
            everything = await param.get_all_params()
            whole = {p.name: float(p.value) for p in everything.int_params}
            real = {p.name: p.value for p in everything.float_params}
            assert {**whole, **real} == values_of(world)
            assert set(real) == {n for n, row in OFFERED.items() if row.kind == "real"}
            await param.set_param_int("RADIO_GAIN", 15)
            await param.set_param_int("RADIO_FREQ_KHZ", 148_705)
            await param.set_param_float("DET_FALSE_ALARM", 0.005)
            assert world.mission.settings.radio.gain == 15
            assert world.mission.settings.radio.center_frequency_hz == 148_705_000.0
            assert world.mission.settings.detection.false_alarm_probability == 0.005
            assert await param.get_param_int("RADIO_GAIN") == 15
            await param.set_param_int("RADIO_GAIN", -1)
            assert world.mission.settings.radio.gain is None
            param.destroy()
        configuration.destroy()

    asyncio.run(main())


def test_mavsdk_gets_our_metadata_by_file_transfer(world: World, until: Until) -> None:
    async def main() -> None:
        configuration = Configuration.create_manual(255, 190, True)
        async with world.flying(), Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
            system = await mavsdk.first_autopilot(timeout_s=20.0)
            await until(lambda: ready(world))
            metadata = ComponentMetadataAsync(system)
            updates = metadata.subscribe_metadata_available()
            waiting = asyncio.create_task(anext(updates))
            await asyncio.sleep(0)
            await metadata.request_component(191)
            update = await asyncio.wait_for(waiting, 60.0)
            assert update.compid == 191
            found = await metadata.get_metadata(191, MetadataType.PARAMETER)
            await updates.aclose()
            listed = json.loads(found.json_metadata)["parameters"]
            assert [entry["name"] for entry in listed] == list(OFFERED)
            assert all(entry["min"] <= entry["default"] <= entry["max"] for entry in listed)
            metadata.destroy()
        configuration.destroy()

    asyncio.run(main())


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


def test_pymavlink_sets_a_parameter_bytewise_and_hears_why_not(
    make_world: Callable[..., World], until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    world = make_world(mavlink={"commanders": (255,)})

    async def main() -> None:
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
            assert await say(mav.param_request_read_encode(1, 191, b"DET_K", -1)) == {
                "DET_K": 0
            }
            assert await say(mav.param_request_read_encode(1, 191, b"", 0)) == {
                "RADIO_GAIN": -1
            }
            unknown = mav.param_request_read_encode(1, 191, b"SYSID_THISMAV", -1)
            assert await say(unknown, mav.param_request_read_encode(1, 191, b"", 99)) == {}
            twelve, forty = (
                struct.unpack("<f", struct.pack("<i", value))[0] for value in (12, 40)
            )
            set_to_twelve = mav.param_set_encode(1, 191, b"RADIO_GAIN", twelve, 6)
            assert await say(set_to_twelve) == {"RADIO_GAIN": 12}
            set_to_forty = mav.param_set_encode(1, 191, b"RADIO_GAIN", forty, 6)
            assert await say(set_to_forty) == {"RADIO_GAIN": 12}
            assert station.texts[-1] == "RADIO_GAIN cannot be 40: whole, 0 to 21, or -1"
            mav.srcSystem = 253  # one that may not command
            set_window = mav.param_set_encode(1, 191, b"DET_WINDOW_HZ", float("nan"), 9)
            told = await say(mav.heartbeat_encode(6, 8, 0, 0, 4), set_to_twelve, set_window)
            assert told == {"RADIO_GAIN": 12, "DET_WINDOW_HZ": 500}
            assert "may not command" in station.texts[-1]
            assert len(world.of(CommandReply)) == 2
        transport.close()

    asyncio.run(main())


@given(st.integers(-(2**22), 2**23), st.booleans())
def test_a_whole_number_comes_back_in_either_encoding(value: int, bytewise: bool) -> None:
    field = encode_value(float(value), MavParamType.INT32, bytewise)
    wire = struct.unpack("<f", struct.pack("<f", field))[0]
    assert decode_value(wire, MavParamType.INT32, bytewise) == value


@pytest.mark.parametrize("kind", [MavParamType.INT64, MavParamType.REAL64, 77])
def test_a_type_that_does_not_fit_the_field_is_no_value(kind: int) -> None:
    assert decode_value(1.0, kind, bytewise=True) is None


MAVPROXY_COMMANDS = """\
module load param
vehicle 1:191
param fetch
param set RADIO_GAIN 15
param set DET_FALSE_ALARM 0.005
param show RADIO_GAIN
"""


@pytest.mark.parametrize(("flavour", "encoding"), [("px4", "float"), ("ardupilot", "auto")])
def test_mavproxy_shows_and_sets_our_parameters(
    make_world: Callable[..., World], tmp_path: Path, flavour: str, encoding: str
) -> None:
    pytest.importorskip("MAVProxy", reason="the extra peer MAVProxy is not installed")
    world = make_world(mavlink={"parameter_encoding": encoding})

    def client() -> str:
        return mavproxy(
            world.ground_port,
            MAVPROXY_COMMANDS,
            tmp_path,
            done=lambda: values_of(world)["DET_FALSE_ALARM"] != 0.0,
            patience_s=30.0,
        )

    async def main() -> None:
        async with world.flying(flavour=flavour):
            said = await asyncio.to_thread(client)
            assert world.mission.settings.radio.gain == 15, said
            assert world.mission.settings.detection.false_alarm_probability == 0.005, said
            assert re.search(r"RADIO_GAIN\s+15", said), said

    asyncio.run(main())
