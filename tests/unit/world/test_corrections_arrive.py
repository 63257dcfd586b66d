"""A correction is listed once the drone searches with it; what cannot be sent is refused."""

import asyncio
from dataclasses import replace
from pathlib import Path

import made
import pytest
from asked_page import AskedPage
from corrected import (
    AWAY_HZ,
    CORRECT,
    HERE_HZ,
    ROW,
    UNDO,
    flight_off_label,
    flown,
    listed_hz,
    off_label,
    press,
)

from uavrt.core.commands import SystemState
from uavrt.core.messages import StatusText
from uavrt.drone.ipc.process import ProcessFrame
from world import World, until


async def test_an_undo_is_refused_until_the_drone_has_answered(tmp_path: Path) -> None:
    async with flight_off_label(tmp_path) as (world, page):
        pressed = asyncio.create_task(press(page, CORRECT))
        await until(lambda: world.mission.upload.tags[2].frequency_hz == AWAY_HZ)
        world.radio_cut()  # its answer is lost
        refused = await press(page, UNDO)
        assert (refused.status, listed_hz(page)) == (422, HERE_HZ), refused.body
        again = await press(page, CORRECT)
        assert (again.status, again.json["message"]) == (409, "Please wait: correcting tag 2")
        world.radio_back()
        words = "tag 2: 148.710640 MHz, was 148.710000 MHz"
        assert (await pressed).json == {"accepted": True, "message": words}
        assert listed_hz(page) == AWAY_HZ
        await until(lambda: world.searched[2].frequency_hz == AWAY_HZ)
        state = await page.state()
        assert (state["beeps"], state["tags_sent"]) == ([], True)
        assert (await press(page, UNDO)).status == 200
        assert listed_hz(page) == world.mission.upload.tags[2].frequency_hz == HERE_HZ
        await until(lambda: world.searched[2].frequency_hz == HERE_HZ)
        assert world.mission.state is SystemState.DETECTING
        texts = [one.text for one in world.of(StatusText)]
        assert "Tag 2: 148.710640 MHz, was 148.710000" in texts


async def test_each_undo_goes_back_by_one_correction_to_the_first_list(tmp_path: Path) -> None:
    page = AskedPage(tmp_path / "ground", World(tmp_path).ground_address)
    places_hz = [HERE_HZ, AWAY_HZ, 148_710_900.0]
    async with page.served():
        assert (await page.ask("PUT", "/api/tags", [ROW])).status == 200
        for at_hz in places_hz[1:]:
            away_hz = at_hz - listed_hz(page)
            page.session.vehicle.drone.beeps[:] = [
                made.beep(frequency_hz=at_hz, tag_ids=(2,), offsets_hz=(away_hz,))
            ]
            request = {"tag_id": 2, "frequency_hz": at_hz}
            assert (await press(page, request)).status == 200
    restarted = AskedPage(page.directory, World(tmp_path).ground_address)
    async with restarted.served():
        for at_hz in reversed(places_hz[:-1]):
            (one,) = (await restarted.state())["corrections"]
            assert one["tag_id"] == 2
            assert (await press(restarted, UNDO)).status == 200
            assert listed_hz(restarted) == at_hz
        assert (await restarted.state())["corrections"] == []
        assert (await press(restarted, UNDO)).status == 422


async def test_without_contact_or_with_two_vehicles_of_one_number_nothing_is_corrected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with flight_off_label(tmp_path) as (world, page):
        session = page.session
        with monkeypatch.context() as patch:
            now = session.vehicle.situation
            patch.setattr(session.vehicle, "situation", lambda: replace(now(), foreign=True))
            foreign = await press(page, CORRECT)
        assert "same number" in foreign.json["message"]
        world.radio_cut()
        unanswered = await press(page, CORRECT)
        assert "did not answer" in unanswered.json["message"]
        await page.until(lambda state: not state["drone"]["present"])
        unreachable = await press(page, CORRECT)
        assert "No contact" in unreachable.json["message"]
        for answer in (foreign, unanswered, unreachable):
            assert answer.status == 409
        assert listed_hz(page) == HERE_HZ
        assert world.mission.upload.tags[2].frequency_hz == HERE_HZ


async def test_a_list_of_another_station_is_corrected_on_the_drone_too(tmp_path: Path) -> None:
    async with flight_off_label(tmp_path, sent_by_page=False) as (world, page):
        assert (await press(page, CORRECT)).status == 200
        assert listed_hz(page) == world.mission.upload.tags[2].frequency_hz == AWAY_HZ


async def test_what_was_measured_before_an_own_correction_is_dropped(tmp_path: Path) -> None:
    world = World(tmp_path)
    page = AskedPage(tmp_path / "ground", world.ground_address)
    of_other_station = off_label(world, frequency_hz=148_711_000.0, offsets_hz=(360.0,))
    async with world.flying(), page.served():
        await flown(world, page)
        page.session.reception.receive_event(of_other_station)
        assert of_other_station in page.session.vehicle.drone.beeps, (
            "measured with a list of another station"
        )
        stale = page.session.vehicle.drone.beeps[0]
        assert (await press(page, CORRECT)).status == 200
        for one in (stale, of_other_station):
            page.session.reception.receive_event(one)
        assert page.session.vehicle.drone.beeps == [of_other_station]


async def test_what_the_old_search_finds_as_it_ends_is_dropped_and_the_new_one_has_its_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = World(tmp_path)
    page = AskedPage(tmp_path / "ground", world.ground_address)
    receive = world._receive

    async def find_more_at_the_end(frame: ProcessFrame) -> None:
        await receive(frame)
        frame.send("beep", off_label(world, pulses=24))

    monkeypatch.setattr(world, "_receive", find_more_at_the_end)
    async with world.flying(), page.served():
        await flown(world, page)
        request = {"name": "DET_K", "value": 7}
        answer = await page.ask("POST", "/api/commands/set_parameter", request)
        assert answer.status == 200, answer.json
        searched = await newer_detector(world)
        assert (await press(page, CORRECT)).status == 200
        searched = await newer_detector(world, searched)
        news = [topic for topic, _ in world.records if topic in ("beep", "corrected_tags")]
        assert news[-2:] == ["beep", "corrected_tags"]
        assert searched.assignment.settings.detection.k == 0
        world.kill("detector-1")
        searched = await newer_detector(world, searched)
        assert searched.assignment.settings.detection.k == 0
        await asyncio.sleep(20.0)
        assert (await page.state())["beeps"] == []


async def newer_detector(world: World, than: ProcessFrame | None = None) -> ProcessFrame:
    """Wait for a detector that was started after another one."""
    launcher = world.computer.launcher

    def newest() -> ProcessFrame | None:
        return launcher._frames.get(launcher.started["detector-1"])

    await until(lambda: newest() not in (None, than))
    found = newest()
    assert found is not None
    return found
