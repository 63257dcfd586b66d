"""*Take back* and link loss while an attacker without the key floods a flying drone's link.

The numbers of trials are those of a short run; ``UAVRT_LINK_TRIALS=200`` makes the campaign of
200 orders taken back and 100 losses of the confirmer.
"""

import asyncio
import contextlib
import os
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from attacked import BATCH_S, CONFIRMER, DRONE, SECRET, Attacker, Guided, key_file, tunnel
from delivered import Delays
from serial_line import ADDRESS, BYTE_S, SerialLine
from some import some
from until import until_async as until

from uavrt.core.messages import SystemStatus
from uavrt.ground.link.motions.motion_requests import (
    confirm,
    motion_request,
    request_motion,
    stop,
)
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    MotionStop,
    encode_confirmation,
    encode_request,
    encode_stop,
)
from uavrt.link.tunnel.own_messages.private import MOTION_TYPE, SEALED_TYPE
from uavrt.link.tunnel.own_messages.seal import MOTION_INSIDE, Key, SealKeeper, seal, session_of

Bay = Any  # tests/unit/processes/conftest.py
TRIALS = int(os.environ.get("UAVRT_LINK_TRIALS", "4"))
pytestmark = pytest.mark.timeout(30 * TRIALS)
KEY = Key(SECRET)
YESTERDAY = tuple(SealKeeper(KEY, number).announcement(DRONE) for number in (11, 12, 13))
LINK_LOST_S = 5.0
LONGEST_BYTES = 280
"""Of a MAVLink 2 frame."""
NORTH, SOUTH = (35.1810, -111.6566), (35.1755, -111.6566)


@pytest.fixture(params=["udp", "serial"])
def line(request: pytest.FixtureRequest) -> Iterator[SerialLine | None]:
    """What connects autopilot and drone's computer: UDP, or a serial line at 57 600 baud."""
    if request.param == "udp":
        yield None
        return
    made = SerialLine()
    with made.installed():
        yield made


@contextlib.asynccontextmanager
async def flying(
    make_bay: Callable[[], Bay], key: Path, line: SerialLine | None = None
) -> AsyncIterator[tuple[Guided, Any]]:
    """A drone in the air and the ground station that has its key."""
    bay = make_bay()
    drone = Guided(bay, key, **({} if line is None else {"address": ADDRESS}))
    if line is not None:
        companion = ("127.0.0.1", line.port)
        bay.autopilot_settings = replace(bay.autopilot_settings, companion=companion)
    async with (
        contextlib.nullcontext() if line is None else line.running(),
        bay.running(),
        bay.ground_station(key=KEY) as (link, _),
    ):
        await until(lambda: link.protocol._sealer.ready)
        await until(lambda: drone.report is not None and drone.report.fault is None)
        yield drone, link


async def take_off_orders(drone: Guided, link: Any) -> None:
    """Ask for a long leg, confirm it, and wait until the drone flies it."""
    vehicle = drone.bay.autopilot.flown.vehicle
    vehicle.body.used_wh = 0.0  # each trial with a full battery
    await asyncio.sleep(3.0)  # it comes to rest: residual motion is not taken for a takeover
    goal = SOUTH if vehicle.body.north_m > 0.0 else NORTH
    offer = await request_motion(link, motion_request("goto", (goal,), height_m=40.0))
    assert offer.kind == "offer"
    assert (await confirm(link, offer, sticks_unseen=False)).kind == "state"
    await until(lambda: drone.standing == "in command")


@contextlib.asynccontextmanager
async def attack(
    drone: Guided, link: Any, line: SerialLine | None = None
) -> AsyncIterator[Attacker]:
    """Send 2000 frames a second while the block runs, or what a serial line carries."""
    with Attacker(drone.bay, link, YESTERDAY) as attacker:

        async def send() -> None:
            while True:
                attacker.batch(4 if line is None else 0)
                await asyncio.sleep(BATCH_S)

        task = asyncio.create_task(send())
        if line is not None:
            line.hostile = attacker.frame
        try:
            yield attacker
        finally:
            if line is not None:
                line.hostile = None
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


def test_every_take_back_acts_within_half_a_second_under_2000_hostile_frames_a_second(
    make_bay: Callable[[], Bay], tmp_path: Path, line: SerialLine | None
) -> None:
    async def main() -> list[float]:
        acted_s = []
        async with flying(make_bay, key_file(tmp_path), line) as (drone, link):
            async with attack(drone, link, line) as attacker:
                if line is not None:
                    line.passed_bytes = line.hostile_frames = 0
                first_s = drone.bay.clock.now_ns() / 1e9
                for number in range(TRIALS):
                    await take_off_orders(drone, link)
                    await asyncio.sleep(0.013 * (number % 31))
                    begun_s = drone.bay.clock.now_ns() / 1e9
                    state = await stop(link)
                    await until(lambda: drone.standing == "out")
                    acted_s.append(some(drone.out_s) - begun_s)
                    assert state.kind == "state", "the drone's own answer, not the forged one"
                lasted_s = drone.bay.clock.now_ns() / 1e9 - first_s
                if line is None:
                    assert attacker.sent >= 1900 * lasted_s
                else:
                    assert line.passed_bytes >= 0.95 * lasted_s / BYTE_S, "the line was full"
                    print(f"{line.hostile_frames / lasted_s:.0f} hostile frames a second")
            assert link.protocol.counters["bad_payloads"] > TRIALS, "forged answers"
        return acted_s

    acted_s = asyncio.run(main())
    assert len(acted_s) == TRIALS
    print(f"acted after {max(acted_s):.3f} s at most")
    assert max(acted_s) <= 0.5


def test_the_loss_of_the_confirmer_is_noticed_though_others_send_under_its_ids(
    make_bay: Callable[[], Bay], tmp_path: Path, line: SerialLine | None
) -> None:
    async def main() -> list[float]:
        noticed_s = []
        async with flying(make_bay, key_file(tmp_path), line) as (drone, link):  # noqa: SIM117
            async with attack(drone, link, line):
                write = link._links._shared.write
                for _ in range(max(2, TRIALS // 2)):
                    await take_off_orders(drone, link)
                    await asyncio.sleep(1.0)
                    lost_s = drone.bay.clock.now_ns() / 1e9
                    link._links._shared.write = lambda message, number: None
                    await until(lambda: drone.lost_s is not None)
                    noticed_s.append(some(drone.lost_s) - lost_s)
                    link._links._shared.write = write
                    await stop(link)
                    await until(lambda: drone.standing == "out")
        return noticed_s

    noticed_s = asyncio.run(main())
    assert len(noticed_s) == max(2, TRIALS // 2)
    print(f"noticed after {min(noticed_s):.2f} to {max(noticed_s):.2f} s")
    assert max(noticed_s) <= LINK_LOST_S + 0.3


def test_pulses_of_a_keyed_drone_are_delayed_by_a_tenth_at_most(
    make_bay: Callable[[], Bay], tmp_path: Path, line: SerialLine | None
) -> None:
    async def p95_s(*, attacked: bool) -> float:
        async with flying(make_bay, key_file(tmp_path), line) as (drone, link):
            delays = Delays(drone.bay)
            link._on_event = delays.append
            drone.bay.deliver("system_status", commanded_by_the_station())
            async with attack(drone, link, line) if attacked else contextlib.nullcontext():
                for number in range(8):  # the station shows that it acknowledges
                    drone.bay.send_pulse(1000 + number)
                    await asyncio.sleep(0.125)
                for number in range(100):
                    delays.send(number)
                    await asyncio.sleep(0.122)
            await asyncio.sleep(1.0)
            return delays.p95_s()

    async def main() -> tuple[float, float]:
        return await p95_s(attacked=False), await p95_s(attacked=True)

    quiet_s, attacked_s = asyncio.run(main())
    print(f"p95 {quiet_s * 1e3:.1f} ms quiet, {attacked_s * 1e3:.1f} ms attacked")
    # On a full line a pulse's pose waits for the hostile frame being sent: 49 ms at most.
    place_s = 0.0 if line is None else LONGEST_BYTES * BYTE_S
    assert attacked_s <= 1.1 * quiet_s + place_s


def commanded_by_the_station() -> SystemStatus:
    return made.system_status(0, commander=f"mavlink {CONFIRMER[0]}/{CONFIRMER[1]}")


async def test_a_station_of_an_older_version_is_refused_with_the_remedy_and_can_still_stop(
    make_bay: Callable[[], Bay], tmp_path: Path
) -> None:
    """It seals for the announced session, proves no session, and sends no sign of life."""
    drone, states = Guided(make_bay(), key_file(tmp_path)), []
    async with drone.bay.running(), drone.bay.ground_station() as (old, _):
        old._on_event = lambda event: (
            states.append(event)
            if isinstance(event, MotionState) and event.request_id
            else None
        )
        await until(lambda: drone.report is not None and drone.report.fault is None)
        gate = drone.bay.process._inbox.stations.gate
        session, *_ = session_of(gate.announcement(DRONE), KEY, DRONE)
        for counter, order in enumerate(
            (
                encode_request(motion_request("goto", (NORTH,), height_m=40.0)),
                encode_stop(MotionStop(request_id=5)),
            ),
            start=1,
        ):
            sealed = seal(order, MOTION_INSIDE, KEY, CONFIRMER, counter, session)
            old.send(tunnel(SEALED_TYPE, sealed))
            await until(lambda: len(states) == counter)  # noqa: B023 - within the turn
    refused, stopped = states
    assert refused.kind == "refused"
    assert "older than the drone's. Update it" in refused.text
    assert (stopped.kind, stopped.request_id) == ("state", 5)


async def test_the_drone_proves_no_answer_to_an_order_without_a_seal(
    make_bay: Callable[[], Bay], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An attacker reads the number of a sealed order and sends its own under the same ids."""
    async with flying(make_bay, key_file(tmp_path)) as (drone, link):
        waiting: list[Any] = []
        offer = drone._offer
        monkeypatch.setattr(drone, "_offer", waiting.append)
        request = motion_request("goto", (NORTH,), height_m=40.0)
        asked = asyncio.create_task(request_motion(link, request))
        await until(lambda: waiting)
        forged = encode_confirmation(
            MotionConfirmation(request_id=request.request_id, order_id=1, nonce=1)
        )
        bad = link.protocol.counters["bad_payloads"]
        with socket.socket(type=socket.SOCK_DGRAM) as stranger:
            stranger.connect(("127.0.0.1", drone.bay.companion_port))
            stranger.send(FrameWriter(*CONFIRMER).encode(tunnel(MOTION_TYPE, forged)))
        await until(lambda: link.protocol.counters["bad_payloads"] > bad)
        assert not asked.done(), "the refusal has no proof"
        offer(waiting[0])
        assert (await asked).kind == "offer"


async def test_without_a_key_a_second_station_with_the_same_ids_keeps_the_order_alive(
    make_bay: Callable[[], Bay],
) -> None:
    """As the manual's table says of a drone without a key: here the simulator on loopback."""
    drone = Guided(make_bay(), None)
    async with drone.bay.running(), drone.bay.ground_station() as (link, _):
        await until(lambda: drone.report is not None and drone.report.fault is None)
        await asyncio.sleep(4.0)  # it identifies the autopilot
        await take_off_orders(drone, link)
        link._links._shared.write = lambda message, number: None
        second = FrameWriter(*CONFIRMER)
        with socket.socket(type=socket.SOCK_DGRAM) as laptop:
            laptop.connect(("127.0.0.1", drone.bay.companion_port))
            for _ in range(10):
                laptop.send(second.encode(link.protocol.heartbeat()))
                await asyncio.sleep(1.0)
            assert drone.lost_s is None
        await until(lambda: drone.lost_s is not None, 7.0)
