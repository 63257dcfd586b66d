"""A write that does not return stops neither the ground station's link nor *Take back*."""

import asyncio
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from searched import Animal
from some import some

from uavrt.flight.flight_recorder import FlightRecorder
from world import World, until

LONGEST_STOP_S = 0.2
HANGS_S = 150.0


def own_s() -> float:
    """Time of this thread without its waits for a processor [s]."""
    waited_ns = int(Path("/proc/thread-self/schedstat").read_text().split()[1])
    return time.monotonic() - waited_ns * 1e-9


class Pace:
    """Longest time between two turns of something that wants one every 5 ms.

    It is made and turned in one thread.
    """

    def __init__(self) -> None:
        self.longest_s, self._before_s = 0.0, own_s()

    def turn(self) -> None:
        now_s = own_s()
        self.longest_s, self._before_s = max(self.longest_s, now_s - self._before_s), now_s


@pytest.mark.timeout(180)
async def test_the_link_goes_on_while_a_write_does_not_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hung, go, real = threading.Event(), threading.Event(), FlightRecorder.commit
    hangs, returned = False, list[bool]()

    def commit(recorder: FlightRecorder, **how: Any) -> None:
        if hangs and "ground" in str(recorder.layout.root):
            hung.set()
            returned.append(go.wait(HANGS_S))
        real(recorder, **how)

    monkeypatch.setattr(FlightRecorder, "commit", commit)
    guidance = {"battery_wh": 120.0, "fence_m": 300.0}
    world = World(tmp_path, animals=[Animal(60.0, 0.0)], guidance=guidance, flies=True)
    over = threading.Event()

    paces: list[Pace] = []

    def watch_machine() -> None:
        paces.append(Pace())
        while not over.wait(0.005):
            paces[0].turn()

    async def watch_loop(loop: Pace) -> None:
        while True:
            await asyncio.sleep(0.005)
            loop.turn()

    async with world.flying(), world.session() as session:
        flying, link = session.flying, some(session.vehicle.connection.link)
        await link.upload_tags(world.tags)
        await link.start_detection()
        await until(lambda: session.vehicle.flight.keeper.pulses)
        await until(lambda: flying.record() is not None)
        await asyncio.sleep(5.0)  # by then the drone knows its autopilot
        loop = Pace()
        threading.Thread(target=watch_machine, daemon=True).start()
        watching = asyncio.create_task(watch_loop(loop))
        hangs = True
        await until(hung.is_set)
        pulses = session.vehicle.flight.keeper.pulses
        offer = await flying.request_motion(
            {"action": "rotate", "duration_s": 60, "height_m": 45}, None
        )
        await flying.confirm({"order_id": offer["order_id"], "sticks_unseen": True}, None)
        await until(lambda: world.vehicle_report.standing == "in command")
        await until(lambda: session.snapshot()["flight"]["fault"] is not None)
        yaw_deg = world.flown.heading.yaw_deg
        await until(lambda: abs((world.flown.heading.yaw_deg - yaw_deg) % 360.0) > 10.0)
        await flying.stop()
        await until(lambda: world.vehicle_report.standing == "out")
        await until(lambda: session.vehicle.flight.keeper.pulses > pulses + 3)
        taken, durable = session.vehicle.flight.keeper.queue.progress
        assert durable <= pulses < taken
        assert not returned, "all this was while the write hung"
        watching.cancel()
        over.set()
        go.set()
        await until(lambda: session.vehicle.flight.keeper.queue.stored)
        assert session.snapshot()["flight"]["fault"] is None
    # Both wait for the same interpreter; the loop waits for nothing else.
    (machine,) = paces
    print(f"longest stop: loop {loop.longest_s:.3f} s, machine {machine.longest_s:.3f} s")
    assert loop.longest_s < LONGEST_STOP_S + machine.longest_s
