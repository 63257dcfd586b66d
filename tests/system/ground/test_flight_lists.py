"""Lists of flights by tag and day: of this computer, and of an archive."""

import shutil
from pathlib import Path
from typing import Any

import pytest
from archived_pulses import archive
from past_flight import write_days
from sql import sql

from uavrt.ground.store.known_flights import FlightChoice
from uavrt.ground.store.stored_flights import FlightLibrary

DAY = "2026-05-{:02d}"


def found(served: Any, query: str) -> tuple[int, list[str]]:
    answer = served.ask("GET", f"/api/found-flights?{query}").json
    return answer["total"], [one["flight_id"] for one in answer["flights"]]


def test_flights_are_listed_by_tag_and_day_so_many_at_a_time(served: Any) -> None:
    names = write_days(served.directory, 5)
    assert found(served, "limit=2") == (5, names[:2:-1])
    assert found(served, "after=4&limit=2") == (5, names[:1])
    assert found(served, "tag=4") == (2, [names[3], names[1]])
    assert found(served, f"from={DAY.format(2)}&to={DAY.format(3)}") == (2, names[2:0:-1])
    assert found(served, f"tag=2&from={DAY.format(2)}&to={DAY.format(2)}") == (0, [])
    assert found(served, f"tag=4&to={DAY.format(2)}") == (1, [names[1]])
    for wrong in ("tag=lynx", "from=yesterday", "to=9999-12-31", "limit=-1"):
        answer = served.ask("GET", f"/api/found-flights?{wrong}")
        assert answer.status == 422
        assert wrong.partition("=")[0] in answer.json["error"]
    # Nothing is set and nothing lies beside the flights.
    nothing: dict[str, Any] = {"directory": None, "total": 0, "flights": []}
    assert served.ask("GET", "/api/archive").json == nothing


def test_what_is_known_of_flights_is_kept_and_no_more_than_known(tmp_path: Path) -> None:
    names = write_days(tmp_path, 3)
    first = FlightLibrary(tmp_path)
    every = first.summaries()
    kept = tmp_path / "flight_list.json"
    assert kept.is_file()
    database = tmp_path / names[0] / "flight.sqlite"
    whole = database.stat()
    # What is kept is what is told: no database is opened for it.
    kept.write_text(kept.read_text().replace("lynx", "wolf"))
    (tmp_path / names[2] / "starred").touch()
    again = FlightLibrary(tmp_path)
    for summary in again.summaries():
        assert summary.starred == (summary.flight_id == names[2])
        assert summary.tags[0].name == "wolf"
    assert [one.flight_id for one in again.summaries()] == [one.flight_id for one in every]
    # Changed flights are read again, flights that are gone are forgotten.
    shutil.rmtree(tmp_path / names[1])
    sql(database, "DELETE FROM pulses WHERE pulse_id > 10")
    assert database.stat().st_mtime_ns != whole.st_mtime_ns
    total, (newest, oldest) = again.find(FlightChoice(), 0, 10)
    assert (total, newest.pulses, oldest.pulses) == (2, 72, 10)
    assert names[1] not in kept.read_text()
    for text in ("{", '{"version": 0, "flights": []}', '{"version": 1, "flights": [1]}'):
        kept.write_text(text)
        assert len(FlightLibrary(tmp_path).summaries()) == 2


def test_flights_of_the_archive_are_listed_and_those_that_are_here_marked(served: Any) -> None:
    (here,) = write_days(served.directory, 1)
    (served.directory / here).rename(served.directory / "03")
    archive(served.directory / "archive")
    answer = served.ask("GET", "/api/archive?tag=4&from=1970-01-21&to=1970-01-31").json
    assert answer["directory"] == str(served.directory / "archive")
    assert answer["total"] == 2
    newest, other = answer["flights"]
    assert (newest["flight"], newest["here"], newest["heard"]) == ("03", True, [[2, 3], [4, 2]])
    assert (other["flight"], other["here"], other["path"]) == ("02", False, "02")
    # Another is named; what is none is refused, and the first stays.
    refused = served.ask("PUT", "/api/settings", {"archive": str(served.directory / "maps")})
    assert refused.status == 422
    assert "recordings.parquet" in refused.json["error"]


def test_an_archive_that_cannot_be_asked_concerns_only_itself(
    served: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive(served.directory / "archive")
    names = write_days(served.directory, 2)
    # What reads an archive is a process of its own: there DuckDB is another one.
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    for duckdb, says in (
        ("raise ImportError(name='duckdb')", "pip install 'uavrt[batch]'"),
        ("while True: pass", "longer than 2 s"),
        ("bytearray(900_000_000)", "more than 200 MB of memory"),
        ("import os; os.abort()", "the process that reads the file has ended"),
    ):
        (tmp_path / "duckdb.py").write_text(duckdb)
        answer = served.ask("GET", "/api/archive")
        assert answer.status == 422
        assert says in answer.json["error"]
        assert found(served, "") == (2, names[::-1])
    (tmp_path / "duckdb.py").unlink()
    assert served.ask("GET", "/api/archive").json["total"] == 9
    # A damaged one is named, too.
    (served.directory / "archive/recordings.parquet").write_bytes(b"PAR1" + bytes(99))
    answer = served.ask("GET", "/api/archive")
    assert (answer.status, len(answer.json["error"].splitlines())) == (422, 1)
    assert "--verify" in answer.json["error"]
