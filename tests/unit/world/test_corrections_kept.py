"""A correction keeps other edits; a full disk or a drone that is off does not stop it."""

import asyncio
import errno
from pathlib import Path
from typing import Any

import made
import pytest
from asked_page import AskedPage
from corrected import (
    AWAY_HZ,
    CORRECT,
    HERE_HZ,
    UNDO,
    flight_off_label,
    listed,
    press,
)

from uavrt.config.tags.tag_corrections import correction_of
from uavrt.core.errors import ConfigError
from uavrt.ground.store import ground_settings as settings
from uavrt.ground.store.ground_settings import GroundStore
from world import World, until


async def edit(page: AskedPage, **changed: Any) -> None:
    (row,) = (await page.ask("GET", "/api/tags")).json
    assert (await page.ask("PUT", "/api/tags", [row | changed])).status == 200


async def test_an_edit_while_the_drone_answers_stays_and_outlives_an_undo(
    tmp_path: Path,
) -> None:
    async with flight_off_label(tmp_path) as (world, page):
        pressed = asyncio.create_task(press(page, CORRECT))
        await until(lambda: world.mission.upload.tags[2].frequency_hz == AWAY_HZ)
        world.radio_cut()
        await edit(page, name="otter")
        world.radio_back()
        assert (await pressed).status == 200
        assert (listed(page).frequency_hz, listed(page).name) == (AWAY_HZ, "otter")
        await edit(page, k=5)
        assert (await press(page, UNDO)).status == 200
        tag = listed(page)
        assert (tag.frequency_hz, tag.name, tag.k) == (HERE_HZ, "otter", 5)
        assert world.mission.upload.tags[2].k == 3, (
            "an edit goes to the drone with the tags alone"
        )
        assert world.mission.upload.tags[2].frequency_hz == HERE_HZ


async def test_on_a_full_disk_the_page_says_what_the_drone_has_and_the_press_can_be_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, **given: Any) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    async with flight_off_label(tmp_path) as (world, page):
        with monkeypatch.context() as patch:
            patch.setattr(settings, "replacing", full)
            refused = await press(page, CORRECT)
        assert refused.status == 422
        words = "tag 2 was corrected on the drone, but not in this station's tag list: "
        assert refused.json["error"].startswith(words)
        assert "No space left" in refused.json["error"]
        state = await page.state()
        assert (listed(page).frequency_hz, page.session.vehicle.store.tags) == (
            HERE_HZ,
            (listed(page),),
        )
        assert (state["tags_sent"], len(state["beeps"])) == (False, 1)
        assert (await press(page, CORRECT)).status == 200
        assert listed(page).frequency_hz == world.mission.upload.tags[2].frequency_hz == AWAY_HZ
        assert (await page.state())["tags_sent"] is True


def test_a_list_that_cannot_be_written_keeps_no_correction_and_stays_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = GroundStore(tmp_path)
    tag = made.tag(2, HERE_HZ)
    store.set_tags((tag,))
    beep = made.beep(frequency_hz=AWAY_HZ, tag_ids=(2,), offsets_hz=(640.0,))
    one = correction_of(tag, beep, 0)
    assert one is not None
    (tmp_path / "tags.toml").unlink()
    (tmp_path / "tags.toml").mkdir()
    (tmp_path / "tags.toml" / "in the way").touch()
    with pytest.raises(ConfigError, match="directory"):
        store.correct_tag(one)
    assert (store.tags, store.corrections) == ((tag,), [])
    assert GroundStore(tmp_path).corrections == []


async def test_the_list_alone_is_corrected_after_minutes_without_a_drone(
    tmp_path: Path,
) -> None:
    async with flight_off_label(tmp_path) as (world, page):
        world.radio_cut()
        await page.until(lambda state: not state["drone"]["present"])
        await asyncio.sleep(120.0)
        refused = await press(page, CORRECT)
        assert refused.status == 409
        assert "No contact" in refused.json["message"]
        assert "After 5 min without contact" in refused.json["message"]
        await asyncio.sleep(181.0)
        answer = await press(page, CORRECT)
        assert answer.status == 200
        assert (
            "Only the list was corrected: send the tags when the drone is back"
            in answer.json["message"]
        )
        assert (listed(page).frequency_hz, world.mission.upload.tags[2].frequency_hz) == (
            AWAY_HZ,
            HERE_HZ,
        )
        assert (await page.state())["tags_sent"] is False
        world.radio_back()
        await page.until(lambda state: state["drone"]["present"])
        assert (await press(page, UNDO)).status == 200
        assert (await page.state())["tags_sent"] is True


async def test_a_station_restarted_after_days_waits_as_long_for_its_drone(
    tmp_path: Path,
) -> None:
    async with flight_off_label(tmp_path) as (_, page):
        directory = page.directory
    restarted = AskedPage(directory, World(tmp_path).ground_address)
    async with restarted.served():
        assert (await restarted.state())["flight"]["ended"] is False
        assert (await press(restarted, CORRECT)).status == 409
        await asyncio.sleep(301.0)
        assert (await press(restarted, CORRECT)).status == 200
        assert listed(restarted).frequency_hz == AWAY_HZ


async def test_what_was_measured_is_offered_after_a_silent_flight(tmp_path: Path) -> None:
    async with flight_off_label(tmp_path) as (_, page):
        page.session.vehicle.flight.end()
        page.session.vehicle.begin_flight()
        page.session.vehicle.flight.end()
        page.session.vehicle.flight.keeper.queue.commit()
        await page.session.vehicle.flight.keeper.queue.settle(5.0)
    (page.directory / "damaged").mkdir()
    (page.directory / "damaged" / "flight.sqlite").write_bytes(b"no database")
    restarted = AskedPage(page.directory, World(tmp_path).ground_address)
    async with restarted.served():
        (beep,) = (await restarted.state())["beeps"]
        assert beep["corrects"] == [{"tag_id": 2, "what": "frequency"}]
