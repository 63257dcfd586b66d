"""Drone side, simulated autopilot and ground station over loopback UDP."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import pytest
from delivered import numbers
from until import until_async as until

from uavrt.config.settings import MavlinkSettings
from uavrt.core.commands import Generation, SystemState
from uavrt.core.earth.attitude import euler_deg
from uavrt.core.errors import CommandRefused, ConfigError, LinkError
from uavrt.core.messages import Command, Pose, Poses, PulsePose, StatusText, Tag
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.protocol import Acknowledged
from uavrt.link.mavlink.component import Handlers
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.tunnel.pulses import pulse_memory
from uavrt.link.tunnel.tunnel_records import tag_to_wire
from world import World

MakeWorld = Callable[..., World]


@pytest.mark.parametrize("generation", ["G0", "G1"])
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_tags_go_up_and_pulses_come_down_without_loss(
    make_world: MakeWorld, thesis_tag: Tag,
    generation: Generation, flavour: str,
) -> None:  # fmt: skip
    world = make_world(mavlink={"tunnel_generation": generation}, flavour=flavour)
    station = world.station(generation=generation)
    async with world.flying() as autopilot, station as (ground, events):
        await ground.upload_tags([thesis_tag])
        await ground.start_detection(center_frequency_hz=148.7e6)
        assert world.mission.upload.tags == {thesis_tag.tag_id: thesis_tag}
        await until(lambda: world.mission.state is SystemState.DETECTING)
        for index in range(30):
            world.find_pulse(index)
        await until(lambda: len(numbers(events)) == 30)
        await ground.stop_detection()
        await until(lambda: world.mission.state is SystemState.HAS_TAGS)
        assert autopilot.counters()["dropped_to_ground"] == 0
    assert sorted(numbers(events)) == list(range(30))
    pulse = next(one.pulse for one in events if isinstance(one, PulsePose))
    assert pulse.end_time_ns - pulse.start_time_ns == 20_000_000


async def test_a_refused_tag_raises_the_drones_reason(world: World, thesis_tag: Tag) -> None:
    async with world.flying(), world.station() as (ground, _):
        wire = tag_to_wire(thesis_tag).encode()
        with pytest.raises(CommandRefused, match="id is 0"):
            await ground.command(wire[:4] + bytes(4) + wire[8:])
        with pytest.raises(CommandRefused, match="TAG has 50 bytes"):
            await ground.command(wire[:50])


async def test_a_command_before_a_drone_is_found_is_refused_with_a_remedy(world: World) -> None:
    ground = GroundLink(world.clock.now_ns)
    task = asyncio.create_task(ground.run(world.ground_address))
    with pytest.raises(LinkError, match="autopilot forwards"):
        await ground.wait_for_drone(0.1)
    with pytest.raises(LinkError, match="no contact with the drone yet"):
        await ground.stop_detection()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_a_drone_that_does_not_answer_is_named(world: World) -> None:
    async with world.flying(), world.station(ack_wait_s=0.05) as (ground, _):
        world.radio_cut()
        with pytest.raises(LinkError, match="did not answer command 6"):
            await ground.stop_detection()
        assert ground.protocol.counters["retries"] == 4


async def test_a_long_status_text_arrives_whole(world: World) -> None:
    text = "All detectors started at 148.700 MHz; two tags share a channel, watch their order."
    async with world.flying(), world.station() as (_, events):
        world.computer.supervisor._notify(4, text)
        await until(lambda: StatusText(severity=4, text=text) in events)


async def test_an_acknowledgement_overtakes_waiting_pulses(world: World) -> None:
    async with world.flying(), world.station() as (ground, events):
        world.detect()
        for index in range(50):
            world.find_pulse(index)
        await until(lambda: numbers(events))
        await ground.stop_detection()
        assert any(isinstance(event, Acknowledged) for event in events)
        assert len(numbers(events)) < 50
        await until(lambda: len(numbers(events)) == 50)


def yaw_errors_deg(world: World, samples: list[Pose]) -> list[float]:
    errors = []
    for sample in samples:
        true = euler_deg(world.vehicle(sample.time_ns).quaternion_wxyz)[0]
        told = euler_deg(sample.quaternion_wxyz)[0]
        errors.append((told - true + 180.0) % 360.0 - 180.0)
    return errors


async def test_poses_have_the_right_time_through_jitter_skew_and_a_reboot(world: World) -> None:
    world.unkept.discard("poses")

    def poses() -> list[Any]:
        return [pose for batch in world.of(Poses) for pose in batch.poses]

    async with world.flying(companion_jitter_s=0.003, clock_skew_ppm=50.0):
        await until(lambda: len(poses()) > 150)
        before = len(poses())
        world.restart_autopilot()
        await until(lambda: len(poses()) > before + 100)
        await until(lambda: world.counter("autopilot_reboots") == 1)
    errors = yaw_errors_deg(world, poses())
    rms = math.sqrt(sum(error**2 for error in errors) / len(errors))
    # The bar is 0.5° rms and 1.5° at most at 30°/s: 17 ms and 50 ms.
    assert rms < 0.5
    assert max(map(abs, errors)) < 1.5


def test_a_gap_below_the_floor_is_refused() -> None:
    handlers = Handlers(
        attitude=lambda s: None, position=lambda s: None, tunnel=lambda p, q: None
    )
    with pytest.raises(ConfigError, match=r"0\.012"):
        Connection(handlers, lambda: 0, MavlinkSettings(tunnel_gap_s=0.005))


async def test_more_pulses_than_memory_keeps_without_a_station_come_from_the_disk(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pulse_memory, "CAPACITY", 200)
    async with world.flying():
        world.detect()
        for index in range(230):
            world.find_pulse(index)
        await until(lambda: world.counter("pulses_recorded", "recorder") == 230)
        async with world.station() as (_, events):
            await until(lambda: len(numbers(events)) >= 230)
    assert set(numbers(events)) == set(range(230))


@pytest.mark.parametrize("generation", ["G1", "G2v1", "G2"])
async def test_the_ground_commands_a_drone_of_each_generation_over_a_lossy_radio(
    make_world: MakeWorld, thesis_tag: Tag, generation: Generation
) -> None:
    world = make_world(mavlink={"tunnel_generation": generation, "tunnel_experimental": True})

    async def insist(step: Any) -> Any:
        """Four tries may all be lost; a person would press again."""
        while True:
            try:
                return await step()
            except LinkError:
                continue

    station = world.station(generation=generation, ack_wait_s=0.2)
    async with world.flying(), station as (ground, _):
        world.radio.loss = 0.2
        await insist(lambda: ground.upload_tags([thesis_tag]))
        directory = await insist(lambda: ground.start_detection(center_frequency_hz=148.7e6))
        assert "flight_log_" in directory
        await until(lambda: "receiver" in world.health)
        assert await insist(lambda: ground.ask("radio_status")) == "receiving"
        await insist(ground.stop_detection)
        await until(lambda: not world.mission.flights.ending)
        await insist(lambda: ground.command(ground.writing.start(148.7e6, 9, "raw_capture")))
        await insist(ground.stop_detection)
        await until(lambda: world.mission.state is SystemState.HAS_TAGS)
        await until(lambda: not world.mission.flights.ending)
        with pytest.raises(CommandRefused, match="again after 10 s to delete 1 flight:"):
            await insist(lambda: ground.ask("clean_logs"))
        with pytest.raises(CommandRefused, match="flash drive not found"):
            await insist(lambda: ground.ask("save_logs"))
        if generation == "G2":
            # What was repeated on the radio reached the supervisor once.
            await until(lambda: world.counter("commands") == len(world.of(Command)))
    assert world.of(Command)[0].name == "start_tags"
    assert world.mission.upload.tags == {thesis_tag.tag_id: thesis_tag}
    (capture, *_) = (c for c in world.of(Command) if c.name == "raw_capture")
    assert (capture.center_frequency_hz, capture.gain) == (148_700_000, 9)
