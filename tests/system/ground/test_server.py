"""The server's promises: to scripts, and against other people's web sites."""

import asyncio
import contextlib
import http.client
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from page_driver import write_map
from until import until_async as until
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from uavrt.analysis.inputs.flight_facts import ReportFacts, facts_of
from uavrt.core.clock import Clock
from uavrt.core.errors import CommandRefused
from uavrt.drone.supervisor.mission.storage.flight_removal import removable
from uavrt.ground.commanding_page import CommandingPage
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.web.access.password_limit import TRIES

TAG = {
    "id": "2",
    "name": "<img src=x onerror=alert(1)>",
    "frequency_mhz": "148,71",
    "interval_ms": 1254,
    "pulse_width_ms": 20,
    "k": 3,
    "false_alarm_percent": 1,
}


def test_a_script_reads_the_state(served: Any) -> None:
    state = served.ask("GET", "/api/state").json
    assert state["connection"]["open"] is True
    assert state["drone"]["present"] is False
    assert state["actions"]["start"] == {
        "label": "Start",
        "enabled": False,
        "reason": "No contact with the drone: check its power and the radio link",
    }


def test_tags_are_kept_over_a_restart(served: Any, serve: Any, tmp_path: Path) -> None:
    assert served.ask("PUT", "/api/tags", [TAG]).status == 200
    (row,) = serve(tmp_path / "ground").ask("GET", "/api/tags").json
    assert row["frequency_mhz"] == 148.71
    assert row["name"] == TAG["name"]


def test_a_wrong_tag_is_told_at_its_field_and_nothing_is_kept(served: Any) -> None:
    answer = served.ask("PUT", "/api/tags", [TAG, TAG | {"frequency_mhz": "148710000"}])
    assert answer.status == 422
    assert {(fault["row"], fault["field"]) for fault in answer.json["faults"]} == {
        (1, "frequency_mhz"),
        (1, "id"),
    }
    assert served.ask("GET", "/api/tags").json == []


def test_a_command_without_a_drone_is_refused_with_the_reason(standing: Any) -> None:
    answer = standing.ask("POST", "/api/commands/start", {})
    assert answer.status == 409
    assert answer.json["accepted"] is False
    assert "No contact" in answer.json["message"]


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:{port}"},
        {"Host": "127.0.0.1.evil.example:{port}"},
        {"Origin": "http://evil.example"},
        {"Origin": "http://evil.example:{port}"},
        {"Origin": "null"},
        {"Origin": "http://localhost:{port}"},
        {"Origin": "https://127.0.0.1:{port}"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {"Content-Type": "text/plain"},
        {"Content-Type": "application/x-www-form-urlencoded"},
    ],
)
def test_other_sites_cannot_command_the_drone(standing: Any, headers: dict[str, str]) -> None:
    sent = {name: value.format(port=standing.port) for name, value in headers.items()}
    assert standing.ask("POST", "/api/commands/mark", {}, sent).status == 403


@pytest.mark.parametrize("path", ["/", "/api/state", "/api/flights"])
def test_a_rebound_name_reads_nothing(standing: Any, path: str) -> None:
    answer = standing.ask("GET", path, headers={"Host": f"evil.example:{standing.port}"})
    assert answer.status == 403
    assert b"drone" not in answer.body


def test_the_own_page_may_command(served: Any) -> None:
    own = {"Origin": f"http://127.0.0.1:{served.port}", "Sec-Fetch-Site": "same-origin"}
    assert served.ask("POST", "/api/commands/mark", {"text": "nest"}, own).status == 200
    log = served.ask("GET", "/api/log").json
    assert log[-1]["text"] == "mark: nest"


def test_live_records_go_to_the_own_page_only(standing: Any) -> None:
    address = f"ws://127.0.0.1:{standing.port}/api/records"

    async def listen(origin: str | None) -> dict[str, object]:
        async with connect(address, origin=origin) as socket:  # type: ignore[arg-type]
            message: dict[str, object] = json.loads(await socket.recv())
            return message

    assert asyncio.run(listen(None))["topic"] == "hello"
    assert asyncio.run(listen(f"http://127.0.0.1:{standing.port}"))["topic"] == "hello"
    with pytest.raises(InvalidStatus):
        asyncio.run(listen("http://evil.example"))


def test_every_answer_forbids_foreign_code(standing: Any) -> None:
    for path in ("/", "/api/state", "/nothing"):
        headers = standing.ask("GET", path).headers
        headers = {name.lower(): value for name, value in headers.items()}
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "http" not in policy
        assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "path",
    [
        "/api/flights/..%2Fetc",
        "/api/flights/.",
        "/api/flights/%2e%2e/columns",
        "/api/flights/nothing/columns",
        "/maps/..%2Fground.json",
        "/maps/ground.json",
        "/assets/..%2F..%2Fserver.py",
        "/assets/%2e%2e/%2e%2e/server.py",
    ],
)
def test_nothing_outside_is_served(standing: Any, path: str) -> None:
    assert standing.ask("GET", path).status == 404


def test_columns_come_by_name_and_poses_as_few_as_wanted(served: Any) -> None:
    clock = Clock.start()
    keeper = FlightKeeper(served.directory, clock)
    flight_id = keeper.begin([])
    for number in range(100):
        pose = made.pose(
            clock.now_ns() + number * 10**9,
            46.5,
            8.0,
            altitude_relative_m=float(number),
            yaw_deg=30.0 + number,
        )
        keeper.add_pose(pose)
    keeper.close()
    path = f"/api/flights/{flight_id}/track"
    every = np.frombuffer(served.ask("GET", path).body).reshape(8, -1)
    assert every.shape == (8, 100)
    nothing = served.ask("GET", f"/api/flights/{flight_id}/columns")
    assert (nothing.status, nothing.body) == (200, b"")
    asked = served.ask("GET", f"{path}?names=altitude_relative_m,yaw_deg&most=30")
    height, yaw = np.frombuffer(asked.body).reshape(2, -1)
    np.testing.assert_array_equal(height, np.arange(3.0, 100.0, 4.0))
    np.testing.assert_allclose(yaw, 30.0 + height)
    refused = served.ask("GET", f"/api/flights/{flight_id}/columns?names=tag_id,speed")
    assert refused.status == 404
    assert "yaw_deg" in refused.json["error"]


def test_a_starred_flight_is_marked_in_its_directory_and_stays(served: Any) -> None:
    keeper = FlightKeeper(served.directory, Clock.start())
    ids = []
    for _ in range(3):
        ids.append(keeper.begin([]))
        keeper.close()
    oldest = min(ids)
    path = f"/api/flights/{oldest}/star"
    assert served.ask("PUT", path, {"starred": True}).json["starred"] is True
    assert served.ask("GET", f"/api/flights/{oldest}").json["starred"] is True
    listed = {
        row["flight_id"]: row["starred"] for row in served.ask("GET", "/api/flights").json
    }
    assert listed == {flight_id: flight_id == oldest for flight_id in ids}
    paths = [served.directory / flight_id for flight_id in ids]
    assert served.directory / oldest not in removable(paths)
    assert served.ask("PUT", path, {"starred": False}).status == 200
    assert served.ask("GET", f"/api/flights/{oldest}").json["starred"] is False
    assert served.ask("PUT", path, {"starred": "yes"}).status == 422
    assert served.ask("PUT", "/api/flights/none/star", {"starred": True}).status == 404


@pytest.mark.parametrize("body", [b"", b"{", b"[[[[", b"[1, 2]", b'"x"', b"\xff"])
def test_what_is_no_table_is_refused_in_words(standing: Any, body: bytes) -> None:
    answer = standing.ask("PUT", "/api/tags", body)
    assert answer.status == 422
    assert answer.json["error"]


def test_a_large_request_is_refused(standing: Any) -> None:
    headers = {"Content-Length": "99999999"}
    assert standing.ask("PUT", "/api/tags", b"[]", headers).status == 403


def test_a_request_without_an_end_is_cut_off(served: Any) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=60)
    connection.putrequest("PUT", "/api/tags")
    connection.putheader("Content-Type", "application/json")
    connection.putheader("Transfer-Encoding", "chunked")
    connection.endheaders()
    sent = 0
    chunk = b" " * 65_536
    with contextlib.suppress(OSError):
        while sent < 50_000_000:
            connection.send(f"{len(chunk):x}\r\n".encode() + chunk + b"\r\n")
            sent += len(chunk)
    with contextlib.suppress(OSError, http.client.HTTPException):
        assert connection.getresponse().status == 413
    connection.close()
    assert sent < 50_000_000
    assert served.ask("GET", "/api/state").status == 200


@pytest.mark.parametrize("path", ["/api/state", "/api/flights", "/maps/a.mbtiles"])
def test_another_site_cannot_even_ask(standing: Any, path: str) -> None:
    for site in ("cross-site", "same-site"):
        assert standing.ask("GET", path, headers={"Sec-Fetch-Site": site}).status == 403
    assert standing.ask("GET", "/", headers={"Sec-Fetch-Site": "cross-site"}).status == 200


@pytest.mark.parametrize("path", ["/api/parameters", "/api/drone/flights"])
def test_nothing_that_is_only_read_makes_the_radio_answer(standing: Any, path: str) -> None:
    assert standing.ask("GET", path).status == 405


def test_two_pages_do_not_overwrite_each_others_tags(served: Any) -> None:
    first = served.ask("PUT", "/api/tags", [TAG]).json["version"]
    mine = served.ask("PUT", "/api/tags", [TAG | {"id": 4}], {"If-Match": f'"{first}"'})
    assert mine.status == 200
    theirs = served.ask("PUT", "/api/tags", [TAG | {"id": 6}], {"If-Match": f'"{first}"'})
    assert theirs.status == 412
    assert [row["id"] for row in theirs.json["tags"]] == [4]
    assert theirs.json["version"] == mine.json["version"]
    assert [row["id"] for row in served.ask("GET", "/api/tags").json] == [4]


def test_a_map_is_brought_by_the_page_whole_or_not_at_all(served: Any, tmp_path: Path) -> None:
    path = tmp_path / "valley.mbtiles"
    write_map(path)
    plain = {"Content-Type": "application/octet-stream"}
    brought = served.ask("PUT", "/api/maps/valley.mbtiles", path.read_bytes(), plain)
    assert (brought.status, brought.json["max_zoom"]) == (200, 3)
    big = b"SQLite format 3\0" + bytes(5_000_000)
    for name, content in (("big.mbtiles", big), ("no.pmtiles", b"x"), ("a.txt", b"x")):
        refused = served.ask("PUT", f"/api/maps/{name}", content, plain)
        assert refused.status == 422
        assert name in refused.json["error"]
        assert ".part" not in refused.json["error"], "it is told by the name that was given"
    odd = served.ask("PUT", "/api/maps/d%27Anniviers.mbtiles", path.read_bytes(), plain)
    assert "letters, digits" in odd.json["error"]
    assert [one["name"] for one in served.ask("GET", "/api/choices").json["maps"]] == [
        "valley.mbtiles"
    ]
    assert len(list((served.directory / "maps").iterdir())) == 1
    other = plain | {"Origin": "http://evil.example"}
    assert served.ask("PUT", "/api/maps/b.mbtiles", path.read_bytes(), other).status == 403


async def test_a_second_page_looks_on_until_it_takes_command(served: Any) -> None:
    first, second = {"X-Page": "first"}, {"X-Page": "second"}
    place = f"ws://127.0.0.1:{served.port}/api/records?page="
    async with connect(place + "first") as one, connect(place + "second"):
        await one.recv()

        def put(page: dict[str, str]) -> int:
            return int(served.ask("PUT", "/api/tags", [TAG], page).status)

        of = asyncio.to_thread
        ask = partial(served.ask, "POST")

        assert await of(put, first) == 200
        assert await of(put, second) == 409
        assert await of(put, {}) == 200, "a script names no page"
        for path, wanted in (
            ("/api/drone/flights", {}),
            ("/api/drone/download", {"flight_id": "flight_log_2026-05-01_10-00-00"}),
            ("/api/parameters", {}),
            ("/api/waterfall", {"address": ""}),
        ):
            refused = await of(ask, path, wanted, second)
            assert (refused.status, "another page" in refused.json["error"]) == (409, True)
        ended = await of(served.ask, "DELETE", "/api/drone/download", {}, second)
        assert ended.status == 409, "the download is of the page that commands"
        stop = await of(ask, "/api/commands/stop", {}, second)
        assert "another page" not in stop.json["message"], "anybody may stop"
        assert (await of(ask, "/api/commander", {}, second)).status == 200
        assert await of(put, second) == 200
        assert await of(put, first) == 409
    # The other has gone, which the station sees in its own time.
    await until(lambda: served.ask("PUT", "/api/tags", [TAG], first).status == 200)


def test_after_a_restart_in_flight_the_page_that_is_back_first_does_not_command() -> None:
    commander = CommandingPage("first")
    commander.page_connected("second")
    assert commander.present is None
    commander.page_connected("first")
    assert commander.present == "first"
    with pytest.raises(CommandRefused):
        commander.check("second")
    commander.page_disconnected("first")
    commander.check("second")
    assert commander.present == "second"


def test_tags_can_be_left_at_home_without_deleting_them(served: Any) -> None:
    served.ask("PUT", "/api/tags", [TAG, TAG | {"id": 4}])
    assert served.ask("PUT", "/api/settings", {"left_out": [4]}).status == 200
    assert served.ask("PUT", "/api/settings", {"left_out": ["4"]}).status == 422
    store = served.station.session.vehicle.store
    assert [tag.tag_id for tag in store.chosen_tags] == [2]
    assert len(store.tags) == 2


def test_what_tagtracker_had_not_selected_is_told_with_the_imported_rows(served: Any) -> None:
    files = {
        "TagInfo.db": "1,2,luna,1,146.1\n0,4,sol,1,146.2\n",
        "TagManufacturer.db": "1,Two,1333,2000,Moving,Resting,15,60,20\n",
    }
    answer = served.ask("POST", "/api/tags/import", files).json
    assert [row["id"] for row in answer["rows"]] == ["2", "4"]
    assert answer["left_out"] == [4]
    only = served.ask(
        "POST", "/api/tags/import", {"TagInfo.txt": "2, 148710000, 1254, 20, 60, 10, 3, .01"}
    )
    assert only.json["left_out"] is None


def test_near_codes_of_a_list_are_named_when_it_is_imported_and_when_it_is_typed(
    served: Any,
) -> None:
    codes = "id,tagFreq,g1,g2,g3,bi\n12,166.38,22,48.8,36.6,5.3\n14,166.38,22.4,48.8,36.6,5.3\n"
    read = served.ask("POST", "/api/tags/import", {"codes.csv": codes}).json
    (words,) = read["warnings"]
    assert words.startswith("codes 12 and 14 are too similar")
    typed = served.ask("POST", "/api/tags/check", read["rows"]).json
    assert typed == {"faults": [], "warnings": [words]}
    alone = served.ask("POST", "/api/tags/check", read["rows"][:1]).json
    assert alone == {"faults": [], "warnings": []}


def test_settings_are_checked_and_kept(served: Any) -> None:
    changed = served.ask("PUT", "/api/settings", {"antenna": "H", "gain": "14"})
    assert changed.json["gain"] == 14
    assert served.ask("PUT", "/api/settings", {"antenna": ["H"]}).status == 422
    wrong = served.ask("PUT", "/api/settings", {"antenna": "H9"})
    assert wrong.status == 422
    assert served.ask("GET", "/api/settings").json["antenna"] == "H"


def test_who_flew_what_is_told_on_the_page_and_stands_in_its_reports(served: Any) -> None:
    assert set(served.ask("GET", "/api/facts").json.values()) == {""}
    told = {"operator": " A. <Ranger> ", "time_zone": "Europe/Zurich"}
    assert served.ask("PUT", "/api/facts", told).json["operator"] == "A. <Ranger>"
    assert served.ask("PUT", "/api/facts", {"species": "Lynx lynx"}).status == 200
    facts = facts_of(served.station.session.vehicle.store.directory / "flight_log_x")
    assert facts == ReportFacts(
        operator="A. <Ranger>", time_zone="Europe/Zurich", species="Lynx lynx"
    )
    faults: list[object] = [{"time_zone": "Moon/Base"}, {"pilot": "x"}, {"permit": 7}, []]
    for wrong in faults:
        assert served.ask("PUT", "/api/facts", wrong).status == 422, wrong
    assert served.ask("PUT", "/api/facts", {"species": ""}).json["species"] == ""
    assert served.ask("GET", "/api/facts").json["time_zone"] == "Europe/Zurich"


def test_with_a_password_nothing_is_told_without_it(
    serve: Callable[..., Any], tmp_path: Path
) -> None:
    station = serve(tmp_path / "ground", password="marmot-7")
    assert station.ask("GET", "/api/state").status == 401
    assert station.ask("GET", "/").status == 401
    script = {"Authorization": "Bearer marmot-7"}
    assert station.ask("GET", "/api/state", headers=script).status == 200
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    for wanted, language, told in (
        ("de-CH,de;q=0.9,en;q=0.8", "de", "Das ist nicht das Passwort."),
        ("fr,en;q=0.5", "en", "This is not the password."),
        ("", "en", "This is not the password."),
    ):
        spoken = form | {"Accept-Language": wanted}
        wrong = station.ask("POST", "/login", b"password=wrong", spoken)
        assert wrong.status == 401
        assert f'lang="{language}"' in wrong.body.decode()
        assert told in wrong.body.decode()
        asked = station.ask("GET", "/", headers={"Accept-Language": wanted}).body.decode()
        assert told not in asked
    answer = station.ask("POST", "/login", b"password=marmot-7", form)
    assert answer.status == 303
    headers = {name.lower(): value for name, value in answer.headers.items()}
    assert "HttpOnly" in headers["set-cookie"]
    cookie = {"Cookie": headers["set-cookie"].partition(";")[0]}
    assert station.ask("GET", "/api/state", headers=cookie).status == 200


def test_a_password_cannot_be_guessed_without_limit(serve: Any, tmp_path: Path) -> None:
    station = serve(tmp_path / "ground", password="marmot-7")
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    cookie = station.ask("POST", "/login", b"password=marmot-7", form).headers["set-cookie"]
    for number in range(TRIES):
        bearer = {"Authorization": f"Bearer guess{number}"}
        assert station.ask("GET", "/api/state", headers=bearer).status in (401, 429)
    right = {"Authorization": "Bearer marmot-7"}
    refused = station.ask("GET", "/api/state", headers=right)
    assert refused.status == 429
    assert int(refused.headers["retry-after"]) > 0
    assert station.ask("POST", "/login", b"password=marmot-7", form).status == 429
    # Who is in stays in.
    known = {"Cookie": cookie.partition(";")[0]}
    assert station.ask("GET", "/api/state", headers=known).status == 200
