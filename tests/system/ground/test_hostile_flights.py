"""Flight folders with hostile contents concern only themselves."""

import os
import signal
import sqlite3
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import made
import pytest
from command_line import launched
from sql import sql

from uavrt.core.errors import FormatError, UavrtError
from uavrt.flight.database import plain_database
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.stored_flights import FlightLibrary

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT {} FROM n"


def flight(directory: Path) -> Path:
    info = made.flight_info(directory, start_time_ns=10**18)
    made.flight(info, pulses=[made.pulse(10**18 + 10**9)])
    return directory


def folder_for_a_database(place: Path) -> None:
    (place / "flight.sqlite").mkdir(parents=True)


def pipe_for_a_database(place: Path) -> None:
    place.mkdir()
    os.mkfifo(place / "flight.sqlite")


def pipe_for_its_log(place: Path) -> None:
    os.mkfifo(flight(place) / "flight.sqlite-wal")


def folder_for_its_log(place: Path) -> None:
    (flight(place) / "flight.sqlite-wal").mkdir()


def endless_view(place: Path) -> None:
    columns = "i AS tag_id, i AS start_time_ns, i AS end_time_ns, i AS pulse_id"
    altered(place, "pulses", f"CREATE VIEW pulses AS {ENDLESS.format(columns)}")


def endless_flight(place: Path) -> None:
    columns = "i AS start_time_ns, i AS clock_offset_ns"
    altered(place, "flight", f"CREATE VIEW flight AS {ENDLESS.format(columns)} WHERE i < 0")


def words_for_numbers(place: Path) -> None:
    pulses = "UPDATE pulses SET end_time_ns = x'ff', tag_id = 1e300"
    sql(flight(place), "UPDATE flight SET start_time_ns = 'noon'", pulses)


def no_tables(place: Path) -> None:
    altered(place, "pulses", "CREATE TABLE other (x)")


def altered(place: Path, table: str, statement: str) -> None:
    sql(flight(place), f"DROP TABLE {table}", statement)


HOSTILE: list[Callable[[Path], None]] = [
    folder_for_a_database,
    pipe_for_a_database,
    pipe_for_its_log,
    folder_for_its_log,
    endless_view,
    endless_flight,
    words_for_numbers,
    no_tables,
]


@pytest.mark.parametrize("make", HOSTILE, ids=lambda make: str(make.__name__))
@pytest.mark.timeout(20)
def test_a_hostile_folder_is_refused_and_left_out_and_the_others_are_listed(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    hostile = tmp_path / "flight_log_0_hostile"
    make(hostile)
    # Its log may be no file: SQLite reads it, or not, but it ends.
    readable = suppress if make is folder_for_its_log else pytest.raises
    with readable(FormatError):
        read_flight(hostile)
    flight(tmp_path / "flight_log_1_good")
    library = FlightLibrary(tmp_path)
    assert "flight_log_1_good" in [one.flight_id for one in library.summaries()]
    for read in (library.summary, library.columns, library.log):
        with suppress(UavrtError):
            read("flight_log_0_hostile")
    assert len(library.records("flight_log_1_good", 0, 9)) == 1


def test_a_query_ends_with_the_program_and_after_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with closing(sqlite3.connect(":memory:", check_same_thread=False)) as database:
        plain_database.limit_queries(database, 0.2)
        with pytest.raises(sqlite3.OperationalError, match="interrupted"):
            database.execute(ENDLESS.format("count(*)")).fetchall()
        monkeypatch.setattr(plain_database, "queries_ended", threading.Event())
        plain_database.limit_queries(database, 3600.0)
        threading.Timer(0.2, plain_database.queries_ended.set).start()
        with pytest.raises(sqlite3.OperationalError, match="interrupted"):
            database.execute(ENDLESS.format("count(*)")).fetchall()


STUCK = """
import sys, threading, time
from uavrt.ground.store.stored_flights import FlightLibrary
FlightLibrary.summaries = lambda self: time.sleep(3600)
sys.argv = ["uavrt", "ground", "--page", "--no-browser", "--port", "0", "-o", sys.argv[1]]
from uavrt.cli.__main__ import main
main()
"""


def test_the_page_ends_on_sigterm_whatever_a_query_does(tmp_path: Path) -> None:
    with launched("-c", STUCK, tmp_path, stderr=subprocess.DEVNULL) as program:
        try:
            assert program.stdout is not None
            address = program.stdout.readline().split()[4]
            asking = threading.Thread(target=_ask, args=(f"{address}api/flights",), daemon=True)
            asking.start()
            time.sleep(1.0)
            assert asking.is_alive()
            program.send_signal(signal.SIGTERM)
            assert program.wait(timeout=60) == 0
        finally:
            program.kill()


def _ask(address: str) -> None:
    with suppress(OSError):
        urllib.request.urlopen(address, timeout=30).close()


def test_a_hostile_folder_is_not_gone_on_with(tmp_path: Path) -> None:
    from uavrt.core.clock import Clock

    endless_view(tmp_path / "flight_log_0")
    keeper = FlightKeeper(tmp_path, Clock.start())
    assert not keeper.resume("flight_log_0")
