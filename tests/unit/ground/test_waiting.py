"""A station without a page says what it waits for, once."""

import asyncio
from pathlib import Path
from typing import Any

from uavrt.config.tags.tag_files import read_tags
from uavrt.ground.station import Station, StationSettings
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.scene.demo_world import demo_scenario


async def test_a_missing_drone_is_reported_once_however_long_it_is_missing(
    tmp_path: Path,
) -> None:
    events: list[dict[str, Any]] = []
    tags = demo_scenario(40.0).tags
    settings = StationSettings(
        address=f"udpin://127.0.0.1:{free_udp_port()}",
        directory=tmp_path / "ground",
        tags=tags,
        start=True,
    )
    station = Station(settings, events.append)
    serving = asyncio.create_task(station.run())
    await asyncio.sleep(50.0)
    station.stop()
    await serving
    waiting = [event["reason"] for event in events if event["event"] == "waiting"]
    assert len(waiting) == 1
    assert waiting[0].startswith(
        "no messages from a drone arrive (MAVLink component 191). Check"
    )
    # Names do not go to the drone: they stay here for its flights.
    names = [tag.name for tag in read_tags(tmp_path / "ground" / "tags.toml")]
    assert names == [tag.name for tag in tags]
