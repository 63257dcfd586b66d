"""Ctrl-C ends a batch within two seconds, whatever it does; what is open is done again.

The seconds are those of the processor: a busy computer makes every end later.
"""

import os
import signal
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from archived import TAGS, record
from archived_pulses import archive
from command_line import launched
from interrupted import interrupted
from past_flight import write_flight
from until import until

from uavrt.analysis.archive.parquet.months import in_duckdb
from uavrt.cli.signals.detect import stop_on_signals


def test_what_does_not_end_by_itself_is_interrupted() -> None:
    begun_s = time.monotonic()

    def work() -> None:
        with stop_on_signals(0.2) as stopped:
            os.kill(os.getpid(), signal.SIGTERM)
            assert stopped() == signal.SIGTERM
            time.sleep(90.0)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert time.monotonic() - begun_s < 45.0
    time.sleep(0.5)  # the timer that would end the program has gone


def test_an_end_in_good_order_is_left_alone() -> None:
    with stop_on_signals(0.2) as stopped:
        os.kill(os.getpid(), signal.SIGINT)
        assert stopped() == signal.SIGINT
    time.sleep(0.6)


@pytest.mark.parametrize("workers", ["1", "2"])
@pytest.mark.parametrize("after_s", [0.0, 0.4, 1.0, 2.0])
def test_ctrl_c_ends_each_stage_in_two_seconds(
    tmp_path: Path, workers: str, after_s: float
) -> None:
    folder = tmp_path / "archive"
    folder.mkdir()
    (tmp_path / "tags.txt").write_text("2, 148706000, 1210, 20, 20, 10, 3, 0.02\n")
    record(folder / "gqrx_20260501_060000_148700000_24000_fc.raw", 60.0, 1, tags=TAGS[:1])
    write_flight(folder, 120.0, 300.0)
    program = launched(
        *("-m", "uavrt.cli", "batch", folder, "--workers", workers),
        *("--tags", tmp_path / "tags.txt", "-o", tmp_path / "out"),
        stdout=None,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert program.stderr is not None
    assert "1 recording, 1 flight" in program.stderr.readline()
    time.sleep(after_s)
    _, said, took_s = interrupted(program)
    assert took_s < 2.0
    ended = (0, -signal.SIGINT) if "placed now" in said and "stopped" not in said else (130,)
    assert program.returncode in ended
    assert "Traceback" not in said


def in_time(sql: str, after_s: float, handler: Any) -> Any:
    """Answer a query of DuckDB; a signal arrives some time after it began."""

    def query(connection: Any) -> Any:
        signal.setitimer(signal.ITIMER_REAL, after_s)
        return connection.execute(sql).fetchall()

    before = signal.signal(signal.SIGALRM, handler)
    try:
        return in_duckdb(query, threads="1")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_what_a_handler_raises_interrupts_a_query_within_one_task() -> None:
    """DuckDB itself looks for signals between two tasks; this one would take minutes."""
    begun_s = time.process_time()
    sql = "SELECT max(a.range * b.range) FROM range(100000000) AS a, range(9999) AS b"
    with pytest.raises(KeyboardInterrupt):
        in_time(sql, 0.3, signal.default_int_handler)
    assert time.process_time() - begun_s < 10.0
    until(lambda: all(one.name != "duckdb" for one in threading.enumerate()), 60.0)


def test_a_signal_that_is_only_noted_ends_no_query() -> None:
    noted: list[int] = []
    sql = "SELECT sum(range) FROM range(20000000)"
    answer = in_time(sql, 0.001, lambda number, _: noted.append(number))
    assert answer == [(199999990000000,)]
    assert noted == [signal.SIGALRM]


@pytest.mark.parametrize(
    ("sql", "after_s"),
    [
        ("SELECT max(a.range * b.range) FROM range(1000000000) AS a, range(9999) AS b", 0.5),
        # one call of a function, which DuckDB does not interrupt
        ("SELECT len(list_sort(list_transform(range(10000000), lambda x: hash(x))))", 1.0),
        ("SELECT range AS number, 'word' AS word FROM range(3000000)", 1.5),
    ],
    ids=["pairs", "function", "rows"],
)
def test_ctrl_c_ends_a_long_query_at_once(tmp_path: Path, sql: str, after_s: float) -> None:
    archive(tmp_path, 1)
    program = launched(
        *("-m", "uavrt.cli", "archive", "query", tmp_path, sql),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    place = Path(f"/proc/{program.pid}")
    until(lambda: "duckdb" in (place / "maps").read_text(), 60.0)
    until(lambda: len(os.listdir(place / "task")) > 1, 60.0)
    time.sleep(after_s)
    assert program.poll() is None
    _, said, took_s = interrupted(program)
    assert took_s < 10.0
    assert (program.returncode, said) == (130, "")


def has_open(pid: int, name: str) -> bool:
    """Whether a program has a file of that name open."""
    with suppress(OSError):  # closed while this looked
        return any(name in os.readlink(one) for one in Path(f"/proc/{pid}/fd").iterdir())
    return False


def test_ctrl_c_ends_a_season_in_two_seconds(tmp_path: Path) -> None:
    first = tmp_path / write_flight(tmp_path, 120.0, 300.0)
    database = (first / "flight.sqlite").read_bytes()
    for number in range(2000):
        place = tmp_path / f"flight_{number}"
        place.mkdir()
        (place / "flight.sqlite").write_bytes(database)
    program = launched(
        *("-m", "uavrt.cli", "season", tmp_path), stderr=subprocess.PIPE, start_new_session=True
    )
    until(lambda: has_open(program.pid, "flight.sqlite"), 60.0)
    said, fault, took_s = interrupted(program)
    assert took_s < 2.0
    assert program.returncode in (130, -signal.SIGINT)
    assert said == ""
    assert "Traceback" not in fault
