"""Our parameters and metadata, read and set by programs that nobody here wrote."""

import asyncio
import contextlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from mavproxy import mavproxy
from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.component_metadata import MetadataType
from mavsdk.plugins.param import ParamError, ProtocolVersion
from tests.unit.mavlink.test_parameters import ready, values_of
from until import until_async as until

from uavrt.config.parameters import OFFERED
from world import World


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_mavsdk_lists_sets_and_reads_our_parameters(world: World, flavour: str) -> None:
    configuration = Configuration.create_manual(255, 190, True)
    async with world.flying(flavour=flavour), Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
        system = await mavsdk.first_autopilot(timeout_s=60.0)
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
        assert world.mission.settings.now.radio.gain == 15
        assert world.mission.settings.now.radio.center_frequency_hz == 148_705_000.0
        assert world.mission.settings.now.detection.false_alarm_probability == 0.005
        assert await param.get_param_int("RADIO_GAIN") == 15
        await param.set_param_int("RADIO_GAIN", -1)
        assert world.mission.settings.now.radio.gain is None
        param.destroy()
    configuration.destroy()


async def test_mavsdk_gets_our_metadata_by_file_transfer(world: World) -> None:
    configuration = Configuration.create_manual(255, 190, True)
    async with world.flying(), Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
        system = await mavsdk.first_autopilot(timeout_s=60.0)
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


MAVPROXY_COMMANDS = """\
module load param
vehicle 1:191
param fetch
param set RADIO_GAIN 15
param set DET_FALSE_ALARM 0.005
param show RADIO_GAIN
"""


@pytest.mark.parametrize(("flavour", "encoding"), [("px4", "float"), ("ardupilot", "auto")])
async def test_mavproxy_shows_and_sets_our_parameters(
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
            patience_s=80.0,
        )

    async with world.flying(flavour=flavour):
        said = await asyncio.to_thread(client)
        assert world.mission.settings.now.radio.gain == 15, said
        assert world.mission.settings.now.detection.false_alarm_probability == 0.005, said
        assert re.search(r"RADIO_GAIN\s+15", said), said
