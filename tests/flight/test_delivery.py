"""Nothing is lost between the recorder and the ground, whatever dies on the way."""

import asyncio
import os
import signal
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import made
import pytest
from listening import linked
from until import until_async as until

from uavrt.core.commands import SystemState
from uavrt.core.errors import LinkError
from uavrt.core.messages import BurstInside, PulseKey, PulsePose
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.link.delivery_receipts import Receipts

CODED_TAG = made.simulated_tag(
    30,
    148_690_000.0,
    1.7,
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    gaps_s=(0.026, 0.054, 0.031),
    k=10,
    north_m=300.0,
    erp_dbm=-20.0,
    crystal_error_ppm=30.0,
)
"""Loud: what is tested is what becomes of its bursts."""


async def persistently(action: Callable[[], Awaitable[object]]) -> None:
    """Give a command until it is answered: at 20 % loss four tries in a row may be lost."""
    for _ in range(5):
        with suppress(LinkError):
            await action()
            return
    raise AssertionError("no answer")


def key_of(item: PulsePose) -> tuple[int, int]:
    """Tag and start of a pulse as it was recorded."""
    return item.pulse.tag_id, item.pulse.start_time_ns


def key_among(recorded: set[tuple[int, int]], item: PulsePose) -> tuple[int, int]:
    """Tag and start of the recorded pulse that a received one is.

    The wire has seconds in a double: a microsecond at best, so the nearest one within two.
    """
    tag_id, start_ns = key_of(item)
    near = [key for key in recorded if key[0] == tag_id and abs(key[1] - start_ns) <= 2_000]
    return near[0] if near else (tag_id, start_ns)


def bursts_of(received: list[PulsePose]) -> set[PulseKey]:
    """Keys of the coded tag's pulses, each of which has the times inside its burst."""
    return {item.pulse.key for item in received if item.pulse.tag_id == CODED_TAG.tag_id}


@pytest.mark.timeout(210)
def test_pulses_survive_loss_a_killed_connection_and_a_restarted_ground_station(
    drone_bay: Any, thesis_scenario: Any
) -> None:
    scenario = replace(thesis_scenario, tag=(*thesis_scenario.tag, CODED_TAG))
    drone = drone_bay.launch(
        scenario, autopilot_options=("--ground-loss", "0.2", "--seed", "5")
    )

    async def fly(
        received: list[PulsePose],
        receipts: Receipts,
        insides: list[BurstInside],
        *,
        first: bool,
        stop: bool,
    ) -> None:
        def take(event: object) -> None:
            if isinstance(event, PulsePose):
                received.append(event)
            if isinstance(event, BurstInside):
                insides.append(event)

        options = {"on_event": take, "ack_wait_s": 1.0, "receipts": receipts}
        async with linked(drone.ground_port, **options) as link:
            if first:
                await persistently(lambda: link.upload_tags(scenario.tags))
                await persistently(link.start_detection)
            await until(lambda: len(received) >= 5, 60.0)
            if first:
                os.kill(drone.pid_of("connection"), signal.SIGKILL)
                await until(lambda: len(received) >= 9, 60.0)
            if stop:
                await persistently(link.stop_detection)
                await asyncio.sleep(6.0)
                await until(lambda: bursts_of(received) <= {one.key for one in insides}, 60.0)

    store_one: list[PulsePose] = []
    insides_one: list[BurstInside] = []
    receipts = Receipts(1)
    asyncio.run(fly(store_one, receipts, insides_one, first=True, stop=False))
    # The same store goes on, then a new, empty one.
    asyncio.run(fly(store_one, receipts, insides_one, first=False, stop=False))
    store_two: list[PulsePose] = []
    insides_two: list[BurstInside] = []
    asyncio.run(fly(store_two, Receipts(2), insides_two, first=False, stop=True))
    # The restarted connection counts its requests from one: none may pass for an old one.
    assert SystemState(drone.status_now().state) is SystemState.HAS_TAGS
    (flight,) = (drone.directory / "flights").glob("flight_log_*")
    recorded = {key_of(item) for item in read_flight(flight).pulse_poses}
    got = Counter(key_among(recorded, item) for item in store_two)
    assert len(recorded) > 9
    assert set(got) == recorded
    assert max(got.values()) == 1
    before = Counter(key_among(recorded, item) for item in store_one)
    assert max(before.values()) == 1
    assert set(before) <= recorded
    # And what is inside the coded tag's bursts, in both stores for the pulses that it follows.
    bursts = bursts_of(store_two)
    assert len(bursts) > 3
    assert {one.key for one in insides_two} == bursts
    assert len(insides_two) == len(bursts)
    assert {one.key for one in insides_one} <= {item.pulse.key for item in store_one}
    for one in insides_two:
        gaps_s = [1e-9 * (b - a) for a, b in pairwise(one.burst_starts_ns)]
        assert gaps_s == pytest.approx(CODED_TAG.gaps_s, abs=1e-3)
