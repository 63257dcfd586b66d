"""Drone side, simulated autopilot and ground station over loopback UDP."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import pytest
from until import until_async as until

from uavrt.config.settings import MavlinkSettings
from uavrt.core.commands import Generation, SystemState
from uavrt.core.earth.attitude import euler_deg
from uavrt.core.errors import CommandRefused, ConfigError, LinkError
from uavrt.core.messages import Pose, Poses, PulsePose, StatusText, Tag
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.protocol import Acknowledged, GroundEvent
from uavrt.link.mavlink.component import Handlers
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.tunnel.tunnel_records import tag_to_wire
from world import World

MakeWorld = Callable[..., World]


def pulses_of(events: list[GroundEvent]) -> list[PulsePose]:
    return [event for event in events if isinstance(event, PulsePose)]


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
        await until(lambda: len(pulses_of(events)) == 30)
        await ground.stop_detection()
        await until(lambda: world.mission.state is SystemState.HAS_TAGS)
        assert autopilot.counters()["dropped_to_ground"] == 0
    received = pulses_of(events)
    assert sorted(round(p.pulse.frequency_hz) for p in received) == [
        148_710_000 + index for index in range(30)
    ]
    assert received[0].pulse.end_time_ns - received[0].pulse.start_time_ns == 20_000_000


async def test_a_refused_tag_raises_the_drones_reason(world: World, thesis_tag: Tag) -> None:
    async with world.flying(), world.station() as (ground, _):
        wire = tag_to_wire(thesis_tag).encode()
        with pytest.raises(CommandRefused, match="id is 0"):
            await ground.command(wire[:4] + bytes(4) + wire[8:])
        with pytest.raises(CommandRefused, match="TAG has 50 bytes"):
            await ground.command(wire[:50])


async def test_a_lossy_radio_is_overcome_by_repetition(world: World, thesis_tag: Tag) -> None:
    async with world.flying(), world.station(ack_wait_s=0.2) as (ground, _):
        world.radio.loss = 0.3
        while world.mission.state is not SystemState.HAS_TAGS:
            try:
                await ground.upload_tags([thesis_tag])
            except LinkError:
                continue  # four tries in a row were lost
        assert world.radio.lost > 0
        assert world.mission.upload.tags == {thesis_tag.tag_id: thesis_tag}


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
        await until(lambda: pulses_of(events))
        await ground.stop_detection()
        assert any(isinstance(event, Acknowledged) for event in events)
        assert len(pulses_of(events)) < 50
        await until(lambda: len(pulses_of(events)) == 50)


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


async def test_an_ardupilot_that_streams_nothing_is_asked_at_our_rates(world: World) -> None:
    async with world.flying(flavour="ardupilot") as autopilot:
        intervals = autopilot.companion.intervals_ns
        await until(lambda: len(intervals) == 3)
        assert intervals == {31: 20_000_000, 33: 100_000_000, 2: 1_000_000_000}


def test_a_gap_below_the_floor_is_refused() -> None:
    handlers = Handlers(
        attitude=lambda s: None, position=lambda s: None, tunnel=lambda p, q: None
    )
    with pytest.raises(ConfigError, match=r"0\.012"):
        Connection(handlers, lambda: 0, MavlinkSettings(tunnel_gap_s=0.005))


async def test_more_pulses_than_memory_keeps_without_a_station_come_from_the_disk(
    world: World,
) -> None:
    async with world.flying():
        world.detect()
        for index in range(2300):
            world.find_pulse(index)
        await until(lambda: world.counter("pulses_recorded", "recorder") == 2300)
        async with world.station() as (_, events):
            await until(lambda: len(pulses_of(events)) >= 2300, 120.0)
    found = {round(p.pulse.frequency_hz) - 148_710_000 for p in pulses_of(events)}
    assert found == set(range(2300))
