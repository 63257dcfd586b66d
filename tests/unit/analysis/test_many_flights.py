"""Copies among flights whose clocks all begin in 1970: found, with each flight read once."""

import random
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import made
import pytest

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.analysis.season import read_season
from uavrt.flight.database.schema import PULSES, insertion

FLIGHTS = 40
_opened: list[int] = [0]


def _count(event: str, _arguments: tuple[object, ...]) -> None:
    if event == "sqlite3.connect":
        _opened[0] += 1


sys.addaudithook(_count)


@pytest.fixture(name="folder")
def folder_fixture(tmp_path: Path) -> Path:
    """Flights of two minutes within the same hour of 1970, a fourth of them received, too."""
    rng = random.Random(1)
    first = tmp_path / "drone" / "flight_00"
    made.flight(made.flight_info(first, (made.tag(2, 148.7e6, 1.2),), start_time_ns=0))
    empty = (first / "flight.sqlite").read_bytes()

    def write(place: Path, start_ns: int, heard: list[tuple[int, float]], note: str) -> None:
        place.mkdir(parents=True, exist_ok=True)
        (place / "flight.sqlite").write_bytes(empty)
        pulses = [made.pulse(at, tag_id=2, snr_db=level, confirmed=True) for at, level in heard]
        with closing(sqlite3.connect(place / "flight.sqlite")) as database:
            database.execute("UPDATE flight SET start_time_ns = ?", [start_ns])
            rows = map(PULSES.row, pulses)
            database.executemany(insertion("pulses", PULSES.names), rows)
            database.execute("INSERT INTO notes VALUES (?, ?)", [start_ns, note])
            database.commit()

    for number in range(FLIGHTS):
        start_ns = 30 * 10**9 + rng.randrange(10**9)
        heard = [
            (start_ns + round(1.2e9 * beat) + rng.randrange(10**8), rng.gauss(15.0, 4.0))
            for beat in range(100 if number % 5 else 0)  # a fifth heard nothing
        ]
        write(tmp_path / "drone" / f"flight_{number:02d}", start_ns, heard, "")
        if number % 4 == 1 and heard:
            received = [one for one in heard if rng.random() < 0.7]
            place = tmp_path / "ground" / f"flight_{number:02d}"
            write(place, start_ns + 10**9, received, "recorded by the ground station")
    return tmp_path


def test_copies_are_found_and_no_flight_is_read_more_than_twice(folder: Path) -> None:
    copies = len([*(folder / "ground").iterdir()])
    assert copies == 8
    _opened[0] = 0
    season = read_season(folder)
    assert (season.flights, season.copies) == (FLIGHTS, copies)
    assert _opened[0] <= 2 * (FLIGHTS + copies)


def test_a_batch_with_nothing_new_opens_no_flight(folder: Path, tmp_path: Path) -> None:
    sought = TagSource(tags=(made.tag(2, 148.7e6, 1.2),))
    runs = []
    for _ in range(2):
        _opened[0] = 0
        found = find_recordings([folder / "drone", folder / "ground"])
        settings = BatchSettings(steps=("attach",), workers=1)
        runs.append(run_batch(found, sought, tmp_path / "out", settings))
    assert [one.placed_now for one in runs] == [FLIGHTS, 0]
    assert (runs[1].placed_before, runs[1].copies, _opened[0]) == (FLIGHTS, 8, 0)
