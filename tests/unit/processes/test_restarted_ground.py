"""A ground station that is started again while the drone detects."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from until import until_async as until

from uavrt.core.messages import Tag
from uavrt.ground.station import Station, StationSettings
from uavrt.link.mavlink import dialect
from uavrt.link.tunnel.tag_lists import digest_in, searched_text, tag_list_digest
from uavrt.link.tunnel.tunnel_records import tag_from_wire, tag_to_wire

TAGS = tuple(
    made.tag(
        2 * number,
        148.71e6 + 1e4 * number,
        *(1.254, 1.5)[: 1 + number % 2],
        interval_uncertainty_s=0.06,
        interval_jitter_s=0.01,
        name=f"animal {number}",
    )
    for number in range(1, 4)
)


def listen(bay: Any, directory: Path, tags: tuple[Tag, ...]) -> list[Any]:
    """Run a station with these tags and --start until it has a pulse; give its events."""
    events: list[Any] = []

    async def main() -> None:
        async with bay.running():
            settings = StationSettings(
                address=f"udpin://127.0.0.1:{bay.ground_port}",
                directory=directory,
                tags=tags,
                start=True,
            )
            station = Station(settings, events.append)
            serving = asyncio.create_task(station.run())
            await until(lambda: any("detect" in event["event"] for event in events))
            bay.send_pulse(1)
            await until(lambda: station.pulses == 1)
            station.stop()
            await serving

    asyncio.run(main())
    return events


def test_a_restarted_station_listens_to_its_own_search(bay: Any, tmp_path: Path) -> None:
    bay.refusals["start_tags"] = f"detecting {searched_text(TAGS)}: send stop first"
    events = listen(bay, tmp_path / "ground", TAGS)
    assert {"event": "already detecting", "tags": [2, 4, 6]} in events
    assert [event for event in events if event["event"] == "stopped"]  # Ctrl-C ends the search
    assert "stop_detection" in [command.name for command in bay.commands]


def test_a_station_with_other_tags_stops_no_search(bay: Any, tmp_path: Path) -> None:
    bay.refusals["start_tags"] = f"detecting {searched_text(TAGS)}: send stop first"
    events = listen(bay, tmp_path / "ground", TAGS[:2])
    (others,) = [event for event in events if event["event"] == "others detected"]
    assert "tags 2, 4, 6" in others["reason"]
    names = [command.name for command in bay.commands]
    assert set(names) == {"start_tags"}


@pytest.mark.parametrize("generation", ["G0", "G1"])
def test_a_list_has_one_digest_by_wire_and_file_and_in_any_order(generation: Any) -> None:
    sent = [tag_from_wire(tag_to_wire(tag, generation)) for tag in reversed(TAGS)]
    assert tag_list_digest(sent) == tag_list_digest(TAGS)
    other = [*TAGS[:2], replace(TAGS[2], pulse_intervals_s=(1.255,))]
    assert tag_list_digest(other) != tag_list_digest(TAGS)


def test_what_is_searched_fits_an_acknowledgement_however_many_tags() -> None:
    many = [replace(TAGS[0], tag_id=2**31 + number) for number in range(400)]
    for tags in ([TAGS[0]], TAGS, many):
        text = searched_text(tags)
        assert len(f"detecting {text}: send stop first") <= 107
        assert digest_in(text) == tag_list_digest(tags)
    assert digest_in("detecting: send stop first") is None


def test_no_order_is_sent_to_two_vehicles_of_one_number(bay: Any, tmp_path: Path) -> None:
    events: list[Any] = []

    async def main() -> None:
        async with bay.running():
            address = f"udpin://127.0.0.1:{bay.ground_port}"
            settings = StationSettings(
                address=address, directory=tmp_path, tags=TAGS, start=True
            )
            station = Station(settings, events.append)
            identity, clock = station.session.vehicle.identity, station.session.vehicle.clock
            identity.choose(1)
            for number in (1, 2):
                version = dialect.AutopilotVersion(uid=number, uid2=bytes(18))
                identity.receive_version(version, clock.now_ns())
            serving = asyncio.create_task(station.run())
            await until(lambda: any(event["event"] == "waiting" for event in events))
            await until(lambda: any(event["event"] == "note" for event in events))
            assert bay.commands == []
            identity.choose(1)
            await until(lambda: any(event["event"] == "started" for event in events))
            station.stop()
            await serving

    asyncio.run(main())
    (waiting,) = [event["reason"] for event in events if event["event"] == "waiting"]
    assert waiting.startswith(
        "two vehicles use the system ID 1. Give each vehicle its own system ID"
    )
    (note,) = [event["text"] for event in events if event["event"] == "note"]
    assert "uses the vehicle number 1: give each vehicle a number of its own" in note
