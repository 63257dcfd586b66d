"""Databases that hold other values or definitions than a flight's are refused."""

import sqlite3
from contextlib import closing
from pathlib import Path

import made
import pytest
from past_flight import TAG, write_flight
from some import some
from sql import sql

from uavrt.analysis.inputs.flown_with import antenna_poses
from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose
from uavrt.flight.database.plain_database import LONGEST_DEFINITION, open_plain
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.tuning import FLIGHT

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    return tmp_path / write_flight(tmp_path, 100.0, 200.0)


@pytest.mark.parametrize(
    "statements",
    [
        ["UPDATE pulses SET snr_db = 'loud'"],
        ["UPDATE poses SET latitude_deg = 'north'"],
        [f"UPDATE pulses SET end_time_ns = {2**63 - 1}"],
        ["UPDATE notes SET text = x'ff'"],
        ["UPDATE tags SET pulse_intervals_s = '[0]'"],
        ["UPDATE tags SET frequency_hz = -1"],
        ["UPDATE health SET counters = '[1]'", "UPDATE health SET process = 'connection'"],
        [
            "DROP TABLE notes",
            "CREATE TABLE notes (time_ns, text AS (printf('%.*c', 9000000, 'x')))",
            f"INSERT INTO notes (time_ns) {ENDLESS} SELECT i FROM n LIMIT 200",
        ],
        [f"ALTER TABLE notes ADD COLUMN more TEXT DEFAULT '{'x' * 900_000}'"],
    ],
)
def test_values_that_are_none_are_refused(flight: Path, statements: list[str]) -> None:
    sql(
        flight,
        "INSERT INTO health (time_ns, process, status, ok, counters)"
        " VALUES (1, 'a', '', 1, '{}')",
    )
    assert read_flight(flight).pulse_poses
    sql(flight, *statements)
    with pytest.raises(FormatError, match=r"flight\.sqlite cannot be read"):
        read_flight(flight)


@pytest.mark.parametrize("settings", ["[1]", '{"antenna": 5}', "[" * 9000, '{"antenna": {"yaw'])
def test_settings_that_are_none_are_refused(flight: Path, settings: str) -> None:
    sql(flight, f"UPDATE flight SET settings = '{settings}'")
    with pytest.raises(FormatError, match=r"the settings of .* cannot be read"):
        antenna_poses(read_flight(flight))


def test_poses_without_an_attitude_are_left_out(flight: Path) -> None:
    poses = len(antenna_poses(read_flight(flight)))
    zero = "UPDATE poses SET " + ", ".join(f"quaternion_{axis} = 0" for axis in "wxyz")
    sql(flight, f"{zero} WHERE time_ns = (SELECT min(time_ns) FROM poses)")
    assert len(antenna_poses(read_flight(flight))) == poses - 1
    sql(flight, zero)
    with pytest.raises(FormatError, match=r"has no pose with an attitude"):
        antenna_poses(read_flight(flight))


def test_a_pulse_of_another_century_stands_for_no_missing_pulses() -> None:
    times_ns = [10**18, 10**18 + 3_600_000_000, 8 * 10**18]
    heard = Heard.of_records(
        [PulsePose(pulse=made.pulse(one), pose=made.pose(one)) for one in times_ns], tags=[TAG]
    )
    missed = heard.pulses[2].missed_ns(some(heard.rhythm(2)))
    assert len(missed) == 2
    assert FLIGHT.most_missed > 24 * 3600


@pytest.mark.parametrize(
    "made",
    [
        "CREATE TABLE odd (one, two GENERATED ALWAYS AS (zeroblob(9)))",
        'CREATE TABLE odd (one, "two"as(1)stored)',
        "CREATE TABLE odd (one, two/**/aS--\n(1))",
        "CREATE VIEW odd AS SELECT 1",
        "CREATE TRIGGER odd AFTER INSERT ON plain BEGIN SELECT 1; END",
        "CREATE VIRTUAL TABLE odd USING rtree(one, two, three)",
        f"CREATE TABLE odd (one DEFAULT '{LONGEST_DEFINITION * '.'}')",
    ],
)
def test_what_makes_more_values_than_are_stored_is_refused(tmp_path: Path, made: str) -> None:
    path = tmp_path / "flight.sqlite"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE plain (phase, as_flown, status DEFAULT 'as sent')")
        database.execute("CREATE INDEX by_phase ON plain (phase)")
    open_plain(path).close()
    with closing(sqlite3.connect(path)) as database:
        database.execute(made)
    with pytest.raises(sqlite3.DatabaseError, match="'odd"):
        open_plain(path)
