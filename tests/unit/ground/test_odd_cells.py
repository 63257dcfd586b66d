"""One odd cell of a flight's database concerns that flight alone, in every list."""

import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest
from past_flight import write_flight
from sql import sql

from uavrt.analysis.estimates.bearings import past_turns
from uavrt.analysis.season import read_season
from uavrt.core.errors import UavrtError
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.page_listeners import encode
from uavrt.ground.store.event_log import EventLog
from uavrt.ground.store.known_flights import FlightChoice, FlightSummary
from uavrt.ground.store.stored_flights import FlightLibrary

GOOD, ODD = "flight_log_2026-05-01_12-00-00", "flight_log_2026-05-02_12-00-00"
VALUES = (None, b"\xff\x00", 1e300)
NOW_NS = 1_777_636_800_000_000_000
MORE = {
    "health": (NOW_NS, "receiver", "ready", 1, '{"noise_dbfs": -60.0}'),
    "status_texts": (NOW_NS, 4, "hello"),
    "commands": (NOW_NS, 1, "start", "ground", "", 1, "ok"),
    "search_reports": (NOW_NS, 2, 148e6, 1e-12, 1.0, 1.0, 10.0),
    "search_notes": (NOW_NS, 1, "begun", "text", "reason", "{}"),
    "notes": (NOW_NS, "vehicle 3, otter"),
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with something in each of its tables."""
    folder = tmp_path_factory.mktemp("flown")
    flight = folder / write_flight(folder, 100.0, 200.0)
    for table, row in MORE.items():
        marks = ", ".join("?" * len(row))
        sql(flight, f"INSERT INTO {table} VALUES ({marks})", values=row)
    return flight


def columns_of(flight: Path) -> Iterator[tuple[str, str]]:
    for (table,) in sql(flight, "SELECT name FROM sqlite_master WHERE type = 'table'"):
        for column in sql(flight, f"PRAGMA table_info({table})"):
            yield table, column[1]


def made_odd(flight: Path, table: str, column: str, value: object) -> bool:
    """Write a value into a column; False where SQLite refuses it."""
    try:
        sql(flight, f"UPDATE OR IGNORE {table} SET {column} = ?", values=(value,))
    except sqlite3.Error:
        return False
    return True


def lists(folder: Path) -> None:
    """Everything that looks at all flights of a folder."""
    library = FlightLibrary(folder)
    summaries = library.summaries()
    assert GOOD in [one.flight_id for one in summaries]
    for one in summaries:  # as a page and the list that is kept take it
        msgspec.convert(msgspec.to_builtins(one), FlightSummary)
    for choice in (FlightChoice(), FlightChoice(tag_id=2), FlightChoice(since_ns=1)):
        assert GOOD in [one.flight_id for one in library.find(choice, 0, 9)[1]]
    assert GOOD in [one.flight_id for one in FlightLibrary(folder).summaries()]
    library.usual_noise_db(3, but=None)
    assert read_season(folder).flights >= 1
    past_turns(read_flight(folder / GOOD), "RA-23K")


def answers(folder: Path) -> list[Callable[[], Any]]:
    """What is asked of one flight."""
    library = FlightLibrary(folder)
    return [
        lambda: library.summary(ODD),
        lambda: library.pulses(ODD).shape,
        lambda: library.poses(ODD).shape,
        lambda: library.records(ODD, 0, 9),
        lambda: library.log(ODD),
        lambda: library.places(ODD),
    ]


@pytest.mark.parametrize("value", VALUES, ids=repr)
@pytest.mark.timeout(300)
def test_an_odd_cell_spoils_no_list_and_no_answer_but_its_flights(
    flown: Path, tmp_path: Path, value: object
) -> None:
    shutil.copytree(flown, tmp_path / GOOD)
    tried = 0
    for table, column in columns_of(flown):
        shutil.rmtree(tmp_path / ODD, ignore_errors=True)
        shutil.copytree(flown, tmp_path / ODD)
        if not made_odd(tmp_path / ODD, table, column, value):
            continue
        tried += 1
        try:
            lists(tmp_path)
            for ask in answers(tmp_path):
                with suppress(UavrtError):
                    encode(ask())
            with suppress(UavrtError):
                read_flight(tmp_path / ODD)
        except Exception as error:
            raise AssertionError(f"{table}.{column} = {value!r}") from error
    assert tried > 50


def test_a_flight_of_300_letters_is_not_there(tmp_path: Path) -> None:
    library = FlightLibrary(tmp_path)
    for name in ("a" * 300, "a\0b", "..", "a/b", ""):
        assert not library.has(name)


def test_odd_lines_of_the_log_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "ground_log.jsonl"
    EventLog(path).add(1, 6, "first", "ground")
    with path.open("a") as file:
        file.write(
            '[]\n{"number": 1}\n{"time_ns": 1, "severity": 4, "text": 5, "source": ""}\n'
        )
        file.write("\x00\n" + "[" * 100_000 + "\n")
    EventLog(path).add(2, 6, "last", "ground")
    lines = EventLog(path).lines()
    assert [(one["number"], one["text"]) for one in lines] == [(1, "first"), (2, "last")]
