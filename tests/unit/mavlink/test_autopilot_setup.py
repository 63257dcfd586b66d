"""``uavrt doctor --autopilot`` against the simulated autopilot with wrong parameters."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import replace

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.errors import ConfigError
from uavrt.drone.computer.autopilot_rules import has_serial_ports, names_to_read, needs
from uavrt.drone.computer.autopilot_setup import _examine, examine_autopilot
from uavrt.drone.computer.finding import Finding
from uavrt.ground.link.drone_link import GroundLink
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import GCS_SYSTEM_ID
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.links.address import parse_address
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.autopilot_parameters import ARDUPILOT_DEFAULTS, PX4_DEFAULTS
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot
from world import World

WRONG_PX4 = {
    "MAV_1_CONFIG": 0,
    "MAV_1_MODE": 0,
    "MAV_1_FORWARD": 0,
    "MAV_0_FORWARD": 0,
    "SER_TEL2_BAUD": 57_600,
}
WRONG_ARDUPILOT = {
    "SERIAL1_PROTOCOL": 1,
    "SERIAL2_PROTOCOL": -1,
    "SERIAL2_BAUD": 57,
    "SERIAL2_OPTIONS": (1 << 10) + 8,
}


@asynccontextmanager
async def autopilot_of(
    world: World, flavour: Flavour, wrong: Mapping[str, float], *, armed: bool = False
) -> AsyncIterator[FakeAutopilot]:
    """A simulated autopilot, in the loop of who examines it."""
    settings = replace(world.settings, flavour=flavour, parameters=wrong, armed=armed)
    assert isinstance(settings, AutopilotSettings)
    autopilot = FakeAutopilot(world.vehicle, settings, world.clock)
    task = asyncio.create_task(autopilot.run())
    try:
        yield autopilot
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


def address_of(world: World) -> str:
    return f"udpin://127.0.0.1:{world.companion_port}"


async def examine(world: World, *, fix: bool = False) -> list[Finding]:
    """What `uavrt doctor --autopilot` does in its own loop."""
    return await _examine(parse_address(address_of(world)), "TELEM2", 921_600, fix)


@pytest.mark.parametrize(
    ("flavour", "wrong", "right"),
    [
        (
            "px4",
            WRONG_PX4,
            {
                "MAV_1_CONFIG": 102,
                "MAV_1_MODE": 2,
                "MAV_1_FORWARD": 1,
                "MAV_0_FORWARD": 1,
                "SER_TEL2_BAUD": 921_600,
            },
        ),
        (
            "ardupilot",
            WRONG_ARDUPILOT,
            {
                "SERIAL1_PROTOCOL": 2,
                "SERIAL2_PROTOCOL": 2,
                "SERIAL2_BAUD": 921,
                "SERIAL2_OPTIONS": 8,
            },
        ),
    ],
)
async def test_wrong_parameters_are_named_and_set_only_when_asked(
    world: World, flavour: Flavour, wrong: dict[str, float], right: dict[str, float]
) -> None:
    async with autopilot_of(world, flavour, wrong) as autopilot:
        before = dict(autopilot.parameters.values)
        found = await examine(world)
        assert autopilot.parameters.values == before
        named = {line.text.split(" ")[0] for line in found if not line.ok}
        assert named == set(wrong)
        assert all("--fix" in line.remedy for line in found if not line.ok)
        fixed = await examine(world, fix=True)
        assert {n: v for n, v in autopilot.parameters.values.items() if before[n] != v} == right
        (left,) = [line for line in fixed if not line.ok]
        assert "restart" in left.text
        assert not autopilot.parameters.passes_on("companion")  # not in force yet
        again = await examine(world)
        assert all(line.ok for line in again)
        autopilot.parameters.restart()
        assert autopilot.parameters.passes_on("companion")
        assert autopilot.parameters.passes_on("ground")


async def test_nothing_is_set_on_an_armed_vehicle(world: World) -> None:
    async with autopilot_of(world, "px4", WRONG_PX4, armed=True) as autopilot:
        before = dict(autopilot.parameters.values)
        (finding,) = await examine(world, fix=True)
        assert not finding.ok
        assert "armed" in finding.text
        assert "Disarm it" in finding.remedy
        assert autopilot.parameters.values == before
        assert len(await examine(world)) > 1  # looking is always allowed


def test_an_autopilot_that_is_not_there_is_said_with_what_to_check(world: World) -> None:
    (finding,) = examine_autopilot(address_of(world), port="TELEM2", baud=921_600)
    assert not finding.ok
    assert "no message from an autopilot arrived" in finding.text
    assert "USB" in finding.remedy


def test_wrong_parameters_let_nothing_through_and_right_ones_do(world: World) -> None:
    for wrong, passes in (
        ({}, True),
        ({"MAV_1_FORWARD": 0}, False),
        ({"MAV_0_FORWARD": 0}, False),
    ):
        settings = replace(world.settings, parameters=wrong)
        autopilot = FakeAutopilot(world.vehicle, settings, world.clock)
        autopilot.ground.port = object()  # type: ignore[assignment]
        beat = made.heartbeat()
        (frame,) = FrameParser().feed(FrameWriter(1, 191).encode(beat))
        autopilot.receive(autopilot.companion, frame, world.clock.now_ns())
        assert (len(autopilot.ground.ring) + autopilot.ground.ring.forwarded == 1) is passes


@pytest.mark.parametrize("as_gcs", [False, True])
def test_our_ground_station_does_not_hide_the_loss_of_the_operators_own(as_gcs: bool) -> None:
    ours = GroundLink(lambda: 0, as_gcs=as_gcs).protocol
    # PX4 counts heartbeats of type GCS, ArduPilot those of MAV_GCS_SYSID, 255. As a station of
    # type GCS, which only the original's drone side needs, we hide the loss.
    assert (ours.heartbeat().type == dialect.MavType.GCS) is as_gcs
    assert (ours.own.system_id == GCS_SYSTEM_ID) is as_gcs


async def test_the_doctor_tells_what_the_loss_of_the_station_does(world: World) -> None:
    cases: tuple[tuple[Flavour, dict[str, float], str], ...] = (
        ("px4", {"NAV_DLL_ACT": 2}, "NAV_DLL_ACT = 2"),
        ("ardupilot", {}, "is lost: none"),
        ("ardupilot", {"MAV_GCS_SYSID": 254}, "would go unnoticed"),
    )
    for flavour, wrong, words in cases:
        async with autopilot_of(world, flavour, wrong):
            (told,) = [line for line in await examine(world) if "operator's" in line.text]
        assert words in told.text
        assert told.ok is ("unnoticed" not in words)


def test_a_px4_without_parameters_of_serial_ports_is_no_fault() -> None:
    told: dict[str, float | None] = dict.fromkeys(names_to_read(True, "TELEM2"))
    assert needs(True, told, "TELEM2", 57_600) == []
    assert not has_serial_ports(told)


def px4(**values: float) -> Callable[[str], set[str]]:
    told = {**PX4_DEFAULTS, **values}
    return lambda port: {n.name for n in needs(True, told, port, 57_600) if not n.met}


def test_a_port_that_mavlink_runs_on_already_keeps_its_instance() -> None:
    assert px4(MAV_2_CONFIG=103)("TELEM3") == {"MAV_2_MODE", "MAV_2_FORWARD", "SER_TEL3_BAUD"}
    assert px4()("TELEM2") == set()


def test_without_a_free_instance_or_a_known_port_the_remedy_says_what_to_do() -> None:
    full = {**PX4_DEFAULTS, "MAV_2_CONFIG": 201}
    with pytest.raises(ConfigError, match="no MAVLink instance is free"):
        needs(True, full, "TELEM3", 57_600)
    for is_px4 in (True, False):
        with pytest.raises(ConfigError, match="TELEM2"):
            names_to_read(is_px4, "GPS9")


def test_ardupilots_new_place_of_the_options_counts_too() -> None:
    told = {**ARDUPILOT_DEFAULTS, "MAV1_OPTIONS": 3.0, "MAV2_OPTIONS": 4.0}
    wrong = [need for need in needs(False, told, "SERIAL2", 57_600) if not need.met]
    assert [(need.name, need.needed) for need in wrong] == [("MAV1_OPTIONS", 1)]


@given(
    st.dictionaries(st.sampled_from(sorted(PX4_DEFAULTS)), st.integers(0, 300)),
    st.sampled_from(["TELEM1", "TELEM2"]),
)
def test_after_all_needs_are_met_there_are_none(changes: dict[str, int], port: str) -> None:
    told: dict[str, float | None] = {**PX4_DEFAULTS, **changes}
    try:
        first = needs(True, told, port, 921_600)
    except ConfigError:
        return
    told |= {need.name: need.needed for need in first}
    again = needs(True, told, port, 921_600)
    assert len(again) == len(first) > 0
    assert all(need.met for need in again)
