"""Flights fetched from the drone by the page's server: real frames, the drone's file server."""

import asyncio
import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import made
import pytest
from file_drone import FileDrone
from tests.system.ground.test_session import until

from uavrt.core.clock import Clock
from uavrt.ground.fetch import ftp_client
from uavrt.ground.store.flight_keeper import FlightKeeper

TAG = made.tag(2, 148.7e6, 1.2)


@pytest.fixture
def flown(tmp_path: Path) -> tuple[Path, str]:
    """The drone's directory with one flight in it, and the flight's name."""
    root = tmp_path / "drone"
    root.mkdir()
    keeper = FlightKeeper(root, Clock.start())
    flight_id = keeper.begin([TAG])
    keeper.close()
    (root / flight_id / "iq").mkdir()
    (root / flight_id / "iq" / "band.sigmf-data").write_bytes(bytes(200_000))
    (root / flight_id / "detector_log" / "a.log").write_text("hello")
    return root, flight_id


@pytest.fixture
def drone(served: Any, flown: tuple[Path, str]) -> Iterator[FileDrone]:
    drone = FileDrone(served.mavlink_port, flown[0])
    until(served, lambda state: state["drone"]["present"])
    yield drone
    drone.close()


def ended(served: Any) -> dict[str, Any]:
    return until(served, lambda record: record and record["ended"], "/api/drone/download")


def test_on_the_drone_s_own_computer_nothing_is_fetched_a_second_time(
    served: Any, drone: FileDrone, flown: tuple[Path, str]
) -> None:
    root, flight_id = flown
    (served.directory / "supervisor.lock").touch()
    shutil.copytree(root / flight_id, served.directory / flight_id)
    assert served.ask("POST", "/api/drone/flights", {}).json == [
        {"flight_id": flight_id, "here": True}
    ]
    refused = served.ask("POST", "/api/drone/download", {"flight_id": flight_id})
    assert refused.status == 422
    assert "this is the drone's own computer" in refused.json["error"]


def test_a_flight_comes_over_the_page_s_own_link(
    served: Any, drone: FileDrone, flown: tuple[Path, str]
) -> None:
    root, flight_id = flown
    assert served.ask("POST", "/api/drone/flights", {}).json == [
        {"flight_id": flight_id, "here": False}
    ]
    started = served.ask("POST", "/api/drone/download", {"flight_id": flight_id})
    assert started.status == 200
    record = ended(served)
    assert record["error"] is None
    files = [path for path in (root / flight_id).rglob("*") if path.is_file()]
    kept = sum(path.stat().st_size for path in files if "iq" not in path.parts)
    assert record["done_bytes"] == record["whole_bytes"] == kept > 0
    place = served.directory / f"{flight_id}_drone"
    for name in ("flight.sqlite", "detector_log/a.log"):
        assert (place / name).read_bytes() == (root / flight_id / name).read_bytes()
    assert not (place / "iq").exists()
    (listed,) = served.ask("GET", "/api/flights").json
    assert listed["flight_id"] == place.name
    assert served.ask("POST", "/api/drone/flights", {}).json[0]["here"] is True


def test_samples_come_when_they_are_asked_for(
    served: Any, drone: FileDrone, flown: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    in_loop: list[str] = []
    for name in ("file_checksum", "place_for"):
        real = getattr(ftp_client, name)

        def noted(*given: Any, name: str = name, real: Any = real) -> Any:
            with contextlib.suppress(RuntimeError):
                asyncio.get_running_loop()
                in_loop.append(name)
            return real(*given)

        monkeypatch.setattr(ftp_client, name, noted)
    wanted = {"flight_id": flown[1], "everything": True}
    served.ask("POST", "/api/drone/download", wanted)
    assert ended(served)["error"] is None
    samples = served.directory / f"{flown[1]}_drone" / "iq" / "band.sigmf-data"
    assert samples.stat().st_size == 200_000
    assert in_loop == [], "whole files are read beside the loop that serves the link"


def test_one_download_at_a_time_and_it_can_be_stopped(
    served: Any, drone: FileDrone, flown: tuple[Path, str]
) -> None:
    drone.silent = True
    wanted = {"flight_id": flown[1]}
    assert served.ask("POST", "/api/drone/download", wanted).status == 200
    assert served.ask("POST", "/api/drone/download", wanted).status == 409
    assert served.ask("POST", "/api/drone/flights", {}).status == 409
    stopped = served.ask("DELETE", "/api/drone/download", {}).json
    assert stopped["ended"] is True
    assert "kept" in stopped["error"]
    drone.silent = False
    assert served.ask("POST", "/api/drone/download", wanted).status == 200
    assert ended(served)["error"] is None


@pytest.mark.parametrize("name", ["", "..", "/etc", "flight_log_1/../..", "maps", 7])
def test_only_flights_are_fetched(standing: Any, name: object) -> None:
    answer = standing.ask("POST", "/api/drone/download", {"flight_id": name})
    assert answer.status == 404
    assert "the drone has no flight" in answer.json["error"]


def test_without_a_drone_it_is_said_so(standing: Any) -> None:
    assert standing.ask("POST", "/api/drone/flights", {}).status == 409
