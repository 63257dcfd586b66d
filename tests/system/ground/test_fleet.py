"""One ground station and several vehicles, over real MAVLink frames on one link."""

import asyncio
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import made
import pytest
from tests.system.ground.test_session import SECOND_NS, Drone, until
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from willing_drone import WillingDrone

from uavrt.core.commands import SystemState
from uavrt.flight.reading.flight_reader import read_flight

TAGS = [
    {
        "id": 7,
        "name": "lynx",
        "frequency_mhz": 148.71,
        "interval_ms": 1254,
        "pulse_width_ms": 20,
    }
]


@pytest.fixture
def both(served: Any) -> Iterator[tuple[Drone, Drone]]:
    """Vehicle 1, which the page takes, and vehicle 2."""
    one, two = Drone(served.mavlink_port), Drone(served.mavlink_port, system=2)

    def others(state: dict[str, Any]) -> list[int]:
        two.heartbeat(SystemState.IDLE)  # again and again: a silent vehicle is not listed
        return list(state["drone"]["others"])

    one.heartbeat(SystemState.IDLE)
    until(served, lambda state: state["drone"]["system_id"] == 1)
    until(served, lambda state: others(state) == [2])
    yield one, two
    one.close()
    two.close()


def serve_second(served: Any) -> None:
    answer = served.ask("POST", "/api/vehicles", {"system_id": 2})
    assert answer.status == 200, answer.json
    assert [one["page"] for one in answer.json] == ["/", "/vehicle/2/"]
    of_second(served, lambda state: state["connection"]["open"])


def of_second(served: Any, what: Any) -> dict[str, Any]:
    return until(served, what, "/vehicle/2/api/state")


def test_a_second_vehicle_is_served_only_when_the_operator_says_so(
    served: Any, both: tuple[Drone, Drone]
) -> None:
    _, two = both
    assert served.ask("GET", "/api/state").json["fleet"] == []
    assert served.ask("GET", "/vehicle/2/api/state").status == 404
    serve_second(served)
    two.heartbeat(SystemState.HAS_TAGS)
    state = of_second(served, lambda state: state["drone"]["state"] == "has_tags")
    assert state["drone"]["system_id"] == 2
    first = served.ask("GET", "/api/state").json
    assert first["drone"]["state"] == "idle"
    assert [one["system_id"] for one in first["fleet"]] == [1, 2]
    assert b"<title>" in served.ask("GET", "/vehicle/2/").body


def test_each_vehicles_pulses_are_in_a_flight_of_its_own_that_says_whose_it_is(
    served: Any, both: tuple[Drone, Drone]
) -> None:
    serve_second(served)
    name = {"vehicle_name": "mast"}
    assert served.ask("PUT", "/vehicle/2/api/settings", name).status == 200
    start_ns = time.time_ns() - SECOND_NS
    for number, drone in enumerate(both):
        drone.heartbeat(SystemState.DETECTING)
        for place in range(3 + number):
            drone.pulse(start_ns + place * SECOND_NS // 10)
    until(served, lambda state: state["flight"]["pulses"] == 3)
    of_second(served, lambda state: state["flight"]["pulses"] == 4)
    flights = {one["vehicle"]: one for one in served.ask("GET", "/api/flights").json}
    assert {name: one["pulses"] for name, one in flights.items()} == {"1": 3, "2, mast": 4}
    assert (
        served.ask("GET", "/vehicle/2/api/flights").json
        == served.ask("GET", "/api/flights").json
    )
    recorded = read_flight(served.directory / flights["2, mast"]["flight_id"])
    assert len(recorded.pulse_poses) == 4


def test_each_vehicle_has_tags_of_its_own_and_begins_with_the_firsts(
    served: Any, both: tuple[Drone, Drone]
) -> None:
    rows = served.ask("PUT", "/api/tags", TAGS).json
    assert rows["faults"] == []
    serve_second(served)
    (theirs,) = served.ask("GET", "/vehicle/2/api/tags").json
    assert theirs["name"] == "lynx"
    assert served.ask("PUT", "/vehicle/2/api/tags", []).json["faults"] == []
    assert len(served.ask("GET", "/api/tags").json) == 1
    assert served.ask("GET", "/vehicle/2/api/tags").json == []


def test_a_station_that_starts_by_itself_starts_and_stops_all_its_vehicles(
    tmp_path: Path, serve: Any
) -> None:
    tag = made.tag(2, 148_612_000.0, 1.3)
    own = {"tags": (tag,), "start": True, "further_vehicles": (2,)}
    station = serve(tmp_path / "ground", page=own)
    # The second is there first: it does not become the first page's.
    drones = {number: WillingDrone(station.mavlink_port, system_id=number) for number in (2, 1)}
    try:
        until(station, lambda state: state["drone"]["state"] == "detecting")
        of_second(station, lambda state: state["drone"]["state"] == "detecting")
        assert [drone.tags for drone in drones.values()] == [1, 1]
        station.stop()
        assert [drone.state for drone in drones.values()] == [SystemState.HAS_TAGS] * 2
    finally:
        for drone in drones.values():
            drone.close()


def test_a_restarted_station_serves_them_again_and_mixes_none_up(
    tmp_path: Path, serve: Any
) -> None:
    station = serve(tmp_path / "ground")
    one, two = Drone(station.mavlink_port), Drone(station.mavlink_port, system=2)
    one.heartbeat(SystemState.IDLE)
    until(station, lambda state: state["drone"]["system_id"] == 1)
    serve_second(station)
    two.heartbeat(SystemState.DETECTING)
    two.pulse(time.time_ns())
    of_second(station, lambda state: state["flight"]["pulses"] == 1)
    one.close()
    two.close()
    station.stop()

    again = serve(tmp_path / "ground")
    of_second(again, lambda state: state["connection"]["open"])
    two = Drone(again.mavlink_port, system=2)
    two.heartbeat(SystemState.DETECTING)
    state = of_second(again, lambda state: state["drone"]["state"] == "detecting")
    assert state["flight"]["pulses"] == 1  # the flight goes on
    assert again.ask("GET", "/api/state").json["drone"]["system_id"] is None
    one = Drone(again.mavlink_port)
    one.heartbeat(SystemState.IDLE)
    until(again, lambda state: state["drone"]["system_id"] == 1)
    one.close()
    two.close()


def test_a_vehicle_that_is_served_no_more_is_one_that_is_heard_again(
    served: Any, both: tuple[Drone, Drone]
) -> None:
    serve_second(served)
    refused = served.ask("POST", "/api/vehicle", {"system_id": 2})
    assert (refused.status, "page of its own" in refused.json["error"]) == (422, True)
    refused = served.ask("POST", "/vehicle/2/api/vehicle", {"system_id": 1})
    assert (refused.status, "belongs to vehicle 2" in refused.json["error"]) == (422, True)
    assert served.ask("DELETE", "/api/vehicles/2", {}).status == 200
    assert served.ask("GET", "/vehicle/2/api/state").status == 404
    assert served.ask("GET", "/api/state").json["fleet"] == []
    assert served.ask("DELETE", "/api/vehicles/2", {}).status == 404


def test_what_is_no_further_vehicle_is_refused(served: Any, both: tuple[Drone, Drone]) -> None:
    for number in (0, 256, -1, 1, "2", True, None, 2.5):
        answer = served.ask("POST", "/api/vehicles", {"system_id": number})
        assert answer.status == 422, number
        assert answer.json["error"], number


def test_records_of_a_vehicle_that_nobody_serves_are_refused(
    served: Any, both: tuple[Drone, Drone]
) -> None:
    address = f"ws://127.0.0.1:{served.port}/vehicle/2/api/records"

    async def first_topic(origin: str | None = None) -> str:
        async with connect(address, origin=origin) as socket:  # type: ignore[arg-type]
            return str(json.loads(await socket.recv())["topic"])

    with pytest.raises(InvalidStatus):
        asyncio.run(first_topic())
    serve_second(served)
    assert asyncio.run(first_topic()) == "hello"
    with pytest.raises(InvalidStatus):
        asyncio.run(first_topic("http://evil.example"))


@pytest.fixture
def willing_both(tmp_path: Path, serve: Any) -> Iterator[tuple[Any, dict[int, WillingDrone]]]:
    """A station that serves vehicles 1 and 2, which do what they are told."""
    station = serve(tmp_path / "ground")
    drones = {1: WillingDrone(station.mavlink_port)}
    until(station, lambda state: state["drone"]["system_id"] == 1)
    assert station.ask("PUT", "/api/tags", TAGS).json["faults"] == []
    drones[2] = WillingDrone(station.mavlink_port, system_id=2)
    until(station, lambda state: state["drone"]["others"] == [2])
    serve_second(station)
    until(station, lambda state: state["drone"]["present"])
    of_second(station, lambda state: state["drone"]["state"] is not None)
    yield station, drones
    for drone in drones.values():
        drone.close()


def both_are(station: Any, expected: str) -> None:
    """Wait for the heartbeats that say so."""
    until(station, lambda state: state["drone"]["state"] == expected)
    of_second(station, lambda state: state["drone"]["state"] == expected)


def to_all(station: Any, name: str, page: str | None = None) -> dict[int, tuple[bool, str]]:
    headers = {} if page is None else {"X-Page": page}
    answer = station.ask("POST", f"/api/vehicles/commands/{name}", {}, headers)
    assert answer.status == 200, answer.json
    told = answer.json["answers"]
    assert answer.json["accepted"] == all(one["accepted"] for one in told)
    return {one["system_id"]: (one["accepted"], one["message"]) for one in told}


def test_all_vehicles_get_their_tags_start_and_stop_at_one_word(
    willing_both: tuple[Any, dict[int, WillingDrone]],
) -> None:
    station, drones = willing_both
    assert to_all(station, "send_tags") == {1: (True, "1 tag sent"), 2: (True, "1 tag sent")}
    assert [drone.tags for drone in drones.values()] == [1, 1]
    both_are(station, "has_tags")
    assert [accepted for accepted, _ in to_all(station, "start").values()] == [True, True]
    assert {drone.state for drone in drones.values()} == {SystemState.DETECTING}
    both_are(station, "detecting")
    assert to_all(station, "stop") == {1: (True, "stopped"), 2: (True, "stopped")}
    assert {drone.state for drone in drones.values()} == {SystemState.HAS_TAGS}


def test_one_vehicle_that_cannot_start_keeps_no_other_from_it_and_says_why(
    willing_both: tuple[Any, dict[int, WillingDrone]],
) -> None:
    station, drones = willing_both
    assert station.ask("POST", "/api/commands/send_tags", {}).status == 200
    until(station, lambda state: state["drone"]["state"] == "has_tags")
    answers = to_all(station, "start")
    assert answers[1][0]
    assert answers[2] == (False, "Send the tags first")
    assert drones[1].state is SystemState.DETECTING


async def test_a_page_that_looks_on_stops_all_and_starts_none(
    willing_both: tuple[Any, dict[int, WillingDrone]],
) -> None:
    """As of one vehicle: to stop can be urgent."""
    station, drones = willing_both
    to_all(station, "send_tags")
    both_are(station, "has_tags")
    addresses = ["/api/records", "/vehicle/2/api/records"]
    base = f"ws://127.0.0.1:{station.port}"
    async with (
        connect(f"{base}{addresses[0]}?page=one") as first,
        connect(f"{base}{addresses[1]}?page=one") as second,
    ):
        await asyncio.gather(first.recv(), second.recv())
        refused = await asyncio.to_thread(to_all, station, "start", "two")
        assert [accepted for accepted, _ in refused.values()] == [False, False]
        assert all("Take command first" in text for _, text in refused.values())
        started = await asyncio.to_thread(to_all, station, "start", "one")
        assert [accepted for accepted, _ in started.values()] == [True, True]
        await asyncio.to_thread(both_are, station, "detecting")
        stopped = await asyncio.to_thread(to_all, station, "stop", "two")
        assert [accepted for accepted, _ in stopped.values()] == [True, True]
    assert {drone.state for drone in drones.values()} == {SystemState.HAS_TAGS}


@pytest.mark.parametrize("name", ["capture", "mark", "goto", "rotate", "restart"])
def test_nothing_but_tags_start_and_stop_goes_to_all(standing: Any, name: str) -> None:
    answer = standing.ask("POST", f"/api/vehicles/commands/{name}", {})
    assert answer.status == 404
    assert "cannot be sent to all vehicles" in answer.json["error"]
