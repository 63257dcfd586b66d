"""Drone side, simulated autopilot and ground station over loopback UDP."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from uavrt import tunnel
from uavrt.attitude import euler_deg
from uavrt.errors import CommandRefused, ConfigError, LinkError
from uavrt.ground.link.drone_link import Acknowledged, GroundEvent, GroundLink
from uavrt.mavlink import Connection, Handlers, Peer, Priority
from uavrt.messages import PulsePose, StatusText, Tag

Until = Callable[..., Awaitable[None]]
MakePulse = Callable[[int, int], PulsePose]
World = Any  # tests/unit/mavlink/conftest.py


def pulses_of(events: list[GroundEvent]) -> list[PulsePose]:
    return [event for event in events if isinstance(event, PulsePose)]


@pytest.mark.parametrize("generation", ["G0", "G1"])
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_tags_go_up_and_pulses_come_down_without_loss(
    world: World, thesis_tag: Tag, until: Until, make_pulse: MakePulse,
    generation: tunnel.Generation, flavour: str,
) -> None:  # fmt: skip
    async def main() -> None:
        events: list[GroundEvent] = []
        ground = GroundLink(world.clock.now_ns, on_event=events.append, generation=generation)
        async with world.flying(flavour=flavour) as autopilot:
            task = asyncio.create_task(ground.run(world.ground_address))
            assert await ground.wait_for_drone(20.0) == Peer(1, 191)
            await ground.upload_tags([thesis_tag])
            await ground.start_detection(center_frequency_hz=148.7e6)
            assert world.drone.tags == [thesis_tag]
            assert world.drone.detecting
            sent = [make_pulse(index, world.clock.now_ns()) for index in range(30)]
            for pulse in sent:
                world.drone.send_pulse(pulse)
            await until(lambda: len(pulses_of(events)) == 30)
            await ground.stop_detection()
            assert not world.drone.detecting
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            assert autopilot.counters()["dropped_to_ground"] == 0
        received = pulses_of(events)
        assert sorted(round(p.pulse.frequency_hz) for p in received) == [
            round(p.pulse.frequency_hz) for p in sent
        ]
        assert received[0].pulse.end_time_ns - received[0].pulse.start_time_ns == 20_000_000

    asyncio.run(main())


def test_a_refused_tag_raises_with_the_drones_reason(world: World, thesis_tag: Tag) -> None:
    async def main() -> None:
        ground = GroundLink(world.clock.now_ns)
        async with world.flying():
            task = asyncio.create_task(ground.run(world.ground_address))
            await ground.wait_for_drone(20.0)
            wire = tunnel.tag_to_wire(thesis_tag).encode()
            with pytest.raises(CommandRefused, match="id is 0"):
                await ground.command(wire[:4] + bytes(4) + wire[8:])
            with pytest.raises(CommandRefused, match="TAG has 50 bytes"):
                await ground.command(wire[:50])
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    asyncio.run(main())


def test_a_lossy_radio_is_overcome_by_repeating_commands(world: World, thesis_tag: Tag) -> None:
    async def main() -> None:
        ground = GroundLink(world.clock.now_ns, ack_wait_s=0.2)
        tags = [thesis_tag]
        async with world.flying(ground_loss=0.3, seed=3) as autopilot:
            task = asyncio.create_task(ground.run(world.ground_address))
            await ground.wait_for_drone(30.0)
            while not world.drone.tags:
                try:
                    await ground.upload_tags(tags)
                except LinkError:
                    continue  # four tries in a row were lost
            assert autopilot.counters()["lost_ground_link"] > 0
            assert world.drone.tags == tags
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    asyncio.run(main())


def test_a_command_before_the_drone_is_found_is_refused_with_a_remedy(world: World) -> None:
    async def main() -> None:
        ground = GroundLink(world.clock.now_ns)
        task = asyncio.create_task(ground.run(world.ground_address))
        with pytest.raises(LinkError, match="autopilot forwards"):
            await ground.wait_for_drone(0.1)
        with pytest.raises(LinkError, match="has not been heard"):
            await ground.stop_detection()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(main())


def test_a_drone_that_does_not_answer_is_named(world: World) -> None:
    async def main() -> None:
        ground = GroundLink(world.clock.now_ns, ack_wait_s=0.05)
        async with world.flying():
            task = asyncio.create_task(ground.run(world.ground_address))
            await ground.wait_for_drone(20.0)
            world.drone.connection.tunnel.send_tunnel = lambda *args: None
            with pytest.raises(LinkError, match="did not answer command 6"):
                await ground.stop_detection()
            assert ground.protocol.counters["retries"] == 4
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    asyncio.run(main())


def test_a_long_status_text_arrives_whole(world: World, until: Until) -> None:
    text = "All detectors started at 148.700 MHz; two tags share a channel, watch their order."

    async def main() -> None:
        events: list[GroundEvent] = []
        ground = GroundLink(world.clock.now_ns, on_event=events.append)
        async with world.flying():
            task = asyncio.create_task(ground.run(world.ground_address))
            await ground.wait_for_drone(20.0)
            world.drone.connection.tunnel.send_text(4, text)
            await until(lambda: events)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        assert events == [StatusText(severity=4, text=text)]

    asyncio.run(main())


def test_an_acknowledgement_overtakes_waiting_pulses(
    world: World, until: Until, make_pulse: MakePulse
) -> None:
    async def main() -> None:
        events: list[GroundEvent] = []
        ground = GroundLink(world.clock.now_ns, on_event=events.append)
        async with world.flying():
            task = asyncio.create_task(ground.run(world.ground_address))
            await ground.wait_for_drone(20.0)
            for index in range(50):
                world.drone.send_pulse(make_pulse(index, world.clock.now_ns()))
            await ground.stop_detection()
            assert any(isinstance(event, Acknowledged) for event in events)
            assert len(pulses_of(events)) < 50
            await until(lambda: len(pulses_of(events)) == 50)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    asyncio.run(main())


def yaw_errors_deg(world: World, samples: list[Any]) -> list[float]:
    errors = []
    for sample in samples:
        true = euler_deg(world.vehicle(sample.time_ns).quaternion_wxyz)[0]
        told = euler_deg(sample.quaternion_wxyz)[0]
        errors.append((told - true + 180.0) % 360.0 - 180.0)
    return errors


def test_attitudes_have_the_right_time_through_jitter_skew_and_a_reboot(
    world: World, until: Until
) -> None:
    async def main() -> None:
        async with world.flying(companion_jitter_s=0.003, clock_skew_ppm=50.0) as autopilot:
            drone = world.drone
            await until(lambda: len(drone.attitudes) > 150)
            assert len(drone.positions) > 10
            before = len(drone.attitudes)
            autopilot.reboot()
            await until(lambda: len(drone.attitudes) > before + 100)
            assert drone.connection.component.counters["autopilot_reboots"] == 1
        errors = yaw_errors_deg(world, drone.attitudes)
        rms = math.sqrt(sum(error**2 for error in errors) / len(errors))
        # The bar is 0.5° rms and 1.5° at most at 30°/s: 17 ms and 50 ms.
        assert rms < 0.5
        assert max(map(abs, errors)) < 1.5

    asyncio.run(main())


def test_an_ardupilot_that_streams_nothing_is_asked_at_our_rates(
    world: World, until: Until
) -> None:
    async def main() -> None:
        async with world.flying(flavour="ardupilot") as autopilot:
            await until(lambda: len(world.drone.attitudes) > 20)
            intervals = autopilot.companion.intervals_ns
            await until(lambda: len(intervals) == 3)
            assert intervals == {31: 20_000_000, 33: 100_000_000, 2: 1_000_000_000}

    asyncio.run(main())


def test_a_gap_below_the_floor_is_refused() -> None:
    handlers = Handlers(
        attitude=lambda s: None, position=lambda s: None, tunnel=lambda p, q: None
    )
    with pytest.raises(ConfigError, match=r"0\.012"):
        Connection(handlers, lambda: 0, gap_s=0.005)


def test_without_a_ground_station_pulses_wait_and_none_is_lost_beside_the_disk(
    world: World, make_pulse: MakePulse
) -> None:
    for index in range(5000):
        world.drone.send_pulse(make_pulse(index, 10**18))
    sender = world.drone.sender
    assert (len(sender), sender.put_back) == (2048, 2952)
    assert sender.wanted() is None  # no room, nobody there
    world.drone.connection.tunnel.send_tunnel(bytes(4), Priority.ACK, Peer(255, 190))
    assert world.drone.connection.tunnel.counters()["tunnel_dropped_ack"] == 0
