"""A search of minutes, from the operator's word to an animal's place."""

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest
from depth import count
from searched import Animal

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import PulsePose, SearchNote
from uavrt.ground.link.motions.motion_requests import confirm, motion_request, request_motion
from uavrt.guidance.control.authority import ControlStage
from world import World, until

SEARCH_S = 60.0 * count(4, 10)
CPU_S = 60.0
"""Ten minutes take 21 s on a machine that is shared with nine others."""
GUIDANCE = {"battery_wh": 120.0, "speed_m_s": 8.0, "keep_away_m": 0.0}


def heard_in(events: list[Any]) -> set[int]:
    """Times of the pulses that have come to the ground, to the millisecond."""
    return {round(e.pulse.start_time_ns, -6) for e in events if isinstance(e, PulsePose)}


@pytest.mark.slow
@pytest.mark.timeout(900)  # a machine that is shared with others
async def test_a_search_of_minutes_goes_on_through_every_fault(tmp_path: Path) -> None:
    # Two whose pulses come at the same moments, and one that is too weak to be heard.
    animals = [
        Animal(90.0, 60.0, level_db=42.0),
        Animal(-90.0, -70.0, level_db=42.0),
        Animal(60.0, -60.0, level_db=-40.0),
    ]
    world = World(tmp_path, animals=animals, guidance=GUIDANCE, flies=True)
    radio = world.radio

    def bad_radio() -> None:
        radio.loss, radio.late_s, radio.copied = 0.1, 0.05, 0.05

    script = [
        (20.0, bad_radio),
        (60.0, world.radio_cut),
        (63.0, world.radio_back),
        (120.0, lambda: world.kill("recorder")),
        (180.0, lambda: world.kill("detector-1")),
    ]
    cpu_s = time.process_time()
    async with world.flying(script), world.station() as (link, events):
        await link.upload_tags(world.tags)
        await link.start_detection()
        search = motion_request("search", radius_m=200.0, accuracy_m=25.0, duration_s=SEARCH_S)
        await asyncio.sleep(5.0)  # by then the drone knows its autopilot
        offer = await request_motion(link, search)
        await confirm(link, offer, sticks_unseen=True)
        begun_ns = world.clock.now_ns()
        await until(lambda: world.standing is ControlStage.IN_COMMAND)
        await until(lambda: world.standing is ControlStage.OUT, 1.2 * SEARCH_S)
        assert (world.clock.now_ns() - begun_ns) / 1e9 == pytest.approx(SEARCH_S, abs=60.0)
        assert world.vehicle_report.reason == "returning: the autopilot flies home"
        radio.loss = radio.late_s = radio.copied = 0.0
        found = {round(one.pulse.start_time_ns, -6) for one in world.of(PulsePose)}
        assert len(found) > 0.5 * SEARCH_S
        await until(lambda: found <= heard_in(events), 60.0)
    assert time.process_time() - cpu_s < CPU_S
    for note in (one for one in world.of(SearchNote) if one.event == "found"):
        assert note.tag_id is not None
        (found_tag,) = [one for one in note.tags if one.tag_id == note.tag_id]
        animal = animals[note.tag_id // 2 - 1]
        true = world.flown.plane.to_geodetic(animal.north_m, animal.east_m)
        assert distance_m(found_tag.latitude_deg, found_tag.longitude_deg, *true) < 40.0
    found_tags = {one.tag_id for one in world.of(SearchNote) if one.event == "found"}
    assert found_tags == {2, 4}
