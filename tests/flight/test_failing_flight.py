"""A flight whose recorder, disk or database fails: the page says so within 5 s."""

import asyncio
import os
import shutil
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from until import until_async as until

from uavrt.core.clock import Clock
from uavrt.core.commands import SystemState
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.session import GroundSession
from uavrt.ground.store.ground_settings import GroundStore

WITHIN_S = 5.0


class Page:
    """What a page shows of a drone: the banner of its state, and its log."""

    def __init__(self, session: GroundSession) -> None:
        self._session = session

    def warnings(self) -> list[str]:
        said = [
            line["text"]
            for line in self._session.vehicle.feed.log.lines()
            if line["severity"] <= 4
        ]
        fault = self._session.snapshot()["flight"]["fault"]
        return said + ([] if fault is None else [fault])

    async def says(self, words: str, hurt: Callable[[], object]) -> None:
        """Have a new warning with these words after something was hurt."""
        known = len(self.warnings())
        begun_s = time.monotonic()
        hurt()
        while not any(words in text for text in self.warnings()[known:]):
            took_s = time.monotonic() - begun_s
            assert took_s < WITHIN_S, f"{words!r} is not in {self.warnings()[known:]}"
            await asyncio.sleep(0.05)


@pytest.fixture
def session(tmp_path: Path) -> GroundSession:
    return GroundSession(GroundStore(tmp_path / "ground"), Clock.start())


@pytest.mark.timeout(180)
async def test_the_page_says_within_5_s_that_recorder_directory_or_database_fail(
    drone_bay: Any, thesis_scenario: Any, session: GroundSession
) -> None:
    drone = drone_bay.launch(thesis_scenario)
    flights = drone.directory / "flights"

    store, page = session.vehicle.store, Page(session)
    store.set_settings(
        store.settings.changed({"address": f"udpin://127.0.0.1:{drone.ground_port}"})
    )
    store.set_tags(thesis_scenario.tags)
    serving = asyncio.create_task(session.run())
    await until(lambda: session.vehicle.situation().drone_present, 30.0)
    assert session.vehicle.connection.link is not None
    await session.commands.send_tags_by(session.vehicle.connection.link)
    await session.commands.start_by(session.vehicle.connection.link)
    await until(lambda: session.vehicle.flight.keeper.pulses >= 3, 60.0)
    (flight,) = flights.glob("flight_log_*")
    await page.says("written again", (flight / "flight.sqlite").unlink)
    for number in (signal.SIGKILL, signal.SIGSTOP):
        pid = await asyncio.to_thread(drone.pid_of, "recorder")
        await page.says("recorder", partial(os.kill, pid, number))
        await asyncio.sleep(6.0)

    def in_the_way() -> None:
        flight.rename(flight.with_name("away"))
        flight.write_text("a file in its place")

    await page.says("cannot write the flight", in_the_way)
    flight.unlink()
    flight.with_name("away").rename(flight)
    await asyncio.sleep(3.0)
    own = session.vehicle.store.directory / str(session.vehicle.flight.keeper.flight_id)
    await page.says("written again", lambda: shutil.rmtree(own))
    await session.vehicle.connection.link.stop_detection()
    await until(lambda: session.vehicle.drone.state is SystemState.HAS_TAGS, 30.0)
    received = {one.pulse.tag_id for one in read_flight(own).pulse_poses}
    assert received == {2}
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)
    (flight,) = flights.glob("flight_log_*")
    recorded = read_flight(flight).pulse_poses
    assert len(recorded) >= session.vehicle.flight.keeper.pulses
