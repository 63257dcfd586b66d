"""A ground station whose disk answers late, or never: the link goes on, receipts wait."""

import asyncio
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pulses import pulse_at
from some import some
from sql import sql

from uavrt.core.clock import Clock
from uavrt.core.messages import Delivered, PulsePose
from uavrt.core.runtime.disk_thread import DiskThread
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.link.received.current_flight import ENDS_WITHIN_S
from uavrt.ground.session import GroundSession
from uavrt.ground.store.flight_keeper import FlightKeeper
from world import THESIS_TAG, World, until

START_NS = 1_777_636_800_000_000_000
SAID_WITHIN_S = 5.0


class LateDisk:
    """Does the ground station's jobs one after the other, each after `late_s`."""

    def __init__(self) -> None:
        self.late_s = 0.0
        self._free_s = 0.0

    def take(self, job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
        loop = asyncio.get_running_loop()
        self._free_s = max(loop.time(), self._free_s) + self.late_s
        if math.isfinite(self._free_s):
            loop.call_at(self._free_s, lambda: then(job()))
        return True


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> LateDisk:
    late, usual = LateDisk(), DiskThread.__call__

    def take(thread: DiskThread, job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
        return late.take(job, then) if thread._early else usual(thread, job, then)

    monkeypatch.setattr(DiskThread, "__call__", take)
    return late


def stored(session: GroundSession) -> int:
    place = (
        session.vehicle.store.directory
        / some(session.vehicle.flight.keeper.flight_id)
        / "flight.sqlite"
    )
    return int(sql(place, "SELECT count(*) FROM pulses")[0][0])


def acknowledged(session: GroundSession) -> int:
    return len(some(some(session.vehicle.connection.link).protocol.receipts)._known)


async def begun(world: World, session: GroundSession) -> None:
    """Detect, with one pulse stored and acknowledged."""
    session.vehicle.store.set_tags((THESIS_TAG,))
    await session.commands.send_tags_by(some(session.vehicle.connection.link))
    await session.commands.start_by(some(session.vehicle.connection.link))
    world.find_pulse(0)
    await until(lambda: acknowledged(session) == 1)


async def test_a_disk_that_takes_5_s_delays_receipts_and_nothing_else(
    tmp_path: Path, disk: LateDisk
) -> None:
    world, loop = World(tmp_path), asyncio.get_running_loop()
    async with world.flying(), world.session() as session:
        await begun(world, session)
        disk.late_s = 5.0
        begun_s, said_s = loop.time(), math.inf
        for number in range(1, 101):
            world.find_pulse(number)
            await asyncio.sleep(0.2)
            assert acknowledged(session) <= stored(session), "not before it is stored"
            if session.snapshot()["flight"]["fault"] is not None:
                said_s = min(said_s, loop.time() - begun_s)
            assert session.vehicle.situation().drone_present
        assert said_s < SAID_WITHIN_S
        assert "s to write" in some(session.snapshot()["flight"]["fault"])
        assert session.vehicle.flight.keeper.pulses > stored(session) + 10, (
            "shown before they are stored"
        )
        assert acknowledged(session) > 1, "later pulses do not hold earlier ones up"
        asked_s = loop.time()
        await some(session.vehicle.connection.link).stop_detection()
        assert loop.time() - asked_s < 0.5
        await until(lambda: acknowledged(session) == 101, 60.0)
        disk.late_s = 0.0
        await until(lambda: session.snapshot()["flight"]["fault"] is None)
        assert stored(session) == 101


async def test_a_disk_that_never_answers_leaves_the_pulses_with_the_drone(
    tmp_path: Path, disk: LateDisk, capsys: pytest.CaptureFixture[str]
) -> None:
    world, loop = World(tmp_path), asyncio.get_running_loop()
    async with world.flying():
        async with world.session() as session:
            await begun(world, session)
            disk.late_s = math.inf
            for number in range(1, 31):
                world.find_pulse(number)
                await asyncio.sleep(0.05)
            # Some are lost on the way; without receipts they are not sent again for ever.
            await until(lambda: session.vehicle.flight.keeper.pulses > 20)
            await session.vehicle.connect()
            await until(lambda: session.vehicle.situation().drone_present)
            asked_s = loop.time()
            await some(session.vehicle.connection.link).stop_detection()
            assert loop.time() - asked_s < 0.5
            await asyncio.sleep(SAID_WITHIN_S)
            wait = session.vehicle.flight.keeper.pulses - 1
            assert f"{wait} pulses wait" in some(session.snapshot()["flight"]["fault"])
            ends_s = loop.time()
        assert loop.time() - ends_s < ENDS_WITHIN_S + 1.0
        assert "the drone keeps them" in capsys.readouterr().err
        receipts = [one for one in world.of(Delivered) if one.store]
        assert sum(len(one.pulses) for one in receipts) == 1
        disk.late_s = disk._free_s = 0.0
        async with world.session() as session:
            await until(lambda: acknowledged(session) == 31, 60.0)
            await until(lambda: stored(session) == 31)


def test_what_was_taken_while_a_write_goes_on_is_not_durable_with_it(tmp_path: Path) -> None:
    jobs: list[Callable[[], None]] = []

    def hold(job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
        jobs.append(lambda: then(job()))
        return True

    keeper = FlightKeeper(tmp_path, Clock.start(), hold)
    pulses = [PulsePose(pulse=pulse_at(START_NS + n * 10**9), pose=None) for n in range(5)]
    flight_id = keeper.begin(())
    for count, pulse in enumerate(pulses, start=1):
        keeper.add_pulse(pulse)
        assert keeper.queue.progress == (count, 0)
        if count == 2:
            jobs.pop(0)()  # the flight is there; both pulses were taken later
            keeper.queue.commit()
    assert keeper.queue.progress == (5, 0)
    jobs.pop(0)()
    assert keeper.queue.progress == (5, 2)
    keeper.close()
    while jobs:
        jobs.pop(0)()
    assert keeper.queue.stored
    assert [one.pulse.key for one in read_flight(tmp_path / flight_id).pulse_poses] == [
        one.pulse.key for one in pulses
    ]


def test_two_flights_of_one_second_have_two_names_before_the_disk_has_either(
    tmp_path: Path,
) -> None:
    keeper = FlightKeeper(tmp_path, Clock.start(), lambda job, then: True)
    assert keeper.begin(()) != keeper.begin(())


def test_flights_of_two_vehicles_have_two_names_before_the_disk_has_either(
    tmp_path: Path,
) -> None:
    begun: set[Path] = set()
    one, other = (
        FlightKeeper(tmp_path, Clock.start(), lambda job, then: True, begun=begun)
        for _ in range(2)
    )
    assert one.begin(()) != other.begin(())
