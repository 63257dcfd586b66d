"""An archive is whole after a power cut, and after anything that was done to its files."""

import json
import os
import random
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import depth
import pyarrow.parquet as pq
import pytest
from archived import TAGS, manifest, record, write_flight
from past_flight import write_flight as write_heard
from power_cut import Names, moments

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.ledger import ASIDE, Ledger
from uavrt.analysis.archive.parquet.months import INDEX
from uavrt.analysis.archive.parquet.parquet_tables import (
    DONE,
    FLIGHTS,
    PULSES,
    RECORDINGS,
    ROWS,
    TABLES,
    RecordingRow,
)
from uavrt.analysis.archive.parquet.seals import read_note, write_note
from uavrt.analysis.archive.recordings import Found, find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.atomic_file import write_atomically

SETTINGS = BatchSettings(steps=("detect", "attach", "bearing"), cell_s=12.0, lead_in_s=4.0)
LISTS = (INDEX, ROWS)
"""By these a lost row is noticed: what was lost with them is made again without a word."""
UNLIKE = ("cpu_s", "finished_time_ns", "finished_utc")
"""Columns that no two runs have the same."""


def search(found: Found, output: Path, **changed: Any) -> BatchSummary:
    return run_batch(found, TagSource(tags=TAGS[:1]), output, replace(SETTINGS, **changed))


def held_in(output: Path) -> dict[str, object]:
    """All rows of an archive, and the names of its files."""
    held: dict[str, object] = {
        name: pq.read_table(output / name).drop_columns(UNLIKE).to_pylist()
        for name in (RECORDINGS, FLIGHTS)
    }
    for table in TABLES:
        files = sorted((output / table).glob("*"))
        held |= {str(one.relative_to(output)): pq.read_table(one).to_pylist() for one in files}
    held["rows"] = sorted(one.name for one in output.glob("[dp][ol][na]*e*/*"))
    others = {one.name for one in (*output.glob("*"), *output.glob("unf*/*"))} - {ASIDE}
    held["others"] = sorted(others)
    return held


def written_in(output: Path) -> list[Path]:
    """What a batch has written, but its lists and what it has set aside."""
    every = sorted(output.rglob("*.*"))
    return [one for one in every if one.name not in LISTS and ASIDE not in one.parts]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    """A recording of two cells, one in a flight, and a flight that heard a tag itself."""
    folder = tmp_path_factory.mktemp("archive")
    flight = write_flight(folder / "flight_a", length_s=20.0)
    (flight / "iq").mkdir(exist_ok=True)
    record(flight / "iq" / "a.cf32", 14.0, 1, tags=TAGS[:1])
    record(folder / "b.cf32", 24.0, 2, tags=TAGS[:1])
    write_heard(folder, 120.0, 300.0)
    told = read_manifest(manifest(folder, "flight_a/iq/a.cf32", "b.cf32"))
    return find_recordings([folder], told)


@pytest.fixture(scope="module")
def whole(found: Found, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive as an undisturbed run writes it."""
    output = tmp_path_factory.mktemp("whole")
    summary = search(found, output)
    assert [row.state for row in summary.rows].count("done") == 2
    assert summary.flights[0].bearings + summary.flights[1].bearings >= 2
    return output


def test_what_was_not_synced_is_lost(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    with moments(disk) as cuts:
        write_atomically(disk / "kept", "all of it")
        write_atomically(disk / "lost", "nothing", sync=False)
    cuts[-1].survives(disk, tmp_path / "synced", "synced")
    cuts[-1].survives(disk, tmp_path / "all", "all")
    assert {one.name: one.read_text() for one in (tmp_path / "synced").iterdir()} == {
        "kept": "all of it"
    }
    assert {one.name: one.read_text() for one in (tmp_path / "all").iterdir()} == {
        "kept": "all of it",
        "lost": "",
    }


@pytest.fixture(scope="module")
def cut_run(found: Found, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    disk = tmp_path_factory.mktemp("disk")
    with moments(disk) as cuts:
        search(found, disk)
    assert len(cuts) > 30
    return disk, cuts


@pytest.mark.parametrize(
    ("share", "names"),
    depth.share([*product((0.1, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0), ("synced", "all"))], 3),
)
def test_a_power_cut_at_any_moment_leaves_an_archive_that_goes_on_by_itself(
    found: Found,
    whole: Path,
    cut_run: tuple[Path, list[Any]],
    tmp_path: Path,
    share: float,
    names: Names,
) -> None:
    disk, cuts = cut_run
    left = tmp_path / "left"
    cuts[round(share * (len(cuts) - 1))].survives(disk, left, names)
    said = search(found, left).damaged
    # Every row that is there has its tables; only copies may be older than their list.
    rows = {name: fault for name, fault in said.items() if "/" in name}
    assert set(rows.values()) <= {"no finished recording or flight refers to it"}
    assert held_in(left) == held_in(whole)
    again = search(found, left)
    assert (again.done_now, again.placed_now, again.damaged) == (0, 0, {})


def delete(path: Path) -> None:
    path.unlink()


def cut_short(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)


def exchange(path: Path) -> None:
    """Put another file's content there."""
    path.write_bytes(random.Random(path.name).randbytes(path.stat().st_size))


def exchange_unseen(path: Path) -> None:
    """Put other content there, of the same size and time."""
    about = path.stat()
    exchange(path)
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))


@pytest.mark.parametrize(
    "damage", depth.share([exchange_unseen, exchange, cut_short, delete], 2)
)
def test_every_damaged_file_is_named_and_made_again(
    found: Found, whole: Path, tmp_path: Path, damage: Callable[[Path], None]
) -> None:
    output = tmp_path / "output"
    search(found, output)
    files = written_in(output)
    assert len(files) >= 12
    for number in range(3):
        hit = {str(one.relative_to(output)): one for one in files[number::3]}
        for one in hit.values():
            if one.exists():  # else its row was hit before, and it is named
                damage(one)
        summary = search(found, output, verify=damage is exchange_unseen)
        assert hit.keys() <= summary.damaged.keys()
        assert held_in(output) == held_in(whole)
        files = written_in(output)
    for name in LISTS:
        damage(output / name)
        assert [*search(found, output, verify=True).damaged] == [name]
    assert search(found, output, verify=True).damaged == {}


def test_rows_that_cannot_be_read_and_tables_of_others_are_kept(
    found: Found, tmp_path: Path
) -> None:
    output = tmp_path / "output"
    search(found, output)
    own = output / "positions" / "2023" / "my_gps.parquet"
    own.parent.mkdir(parents=True)
    for path in (own, output / "pulses" / "own.parquet"):
        path.write_bytes(b"not of a batch")
    rows = sorted(output.glob("done/*.json"))
    tables = {one: one.read_bytes() for one in output.glob("pulses/*.parquet")}
    for row in rows:  # as another version wrote it
        row.write_bytes(b"{}")
    search(found, output)
    assert own.read_bytes() == (output / "pulses" / "own.parquet").read_bytes()
    aside = {one.name: one.read_bytes() for one in (output / ASIDE).rglob("*.parquet")}
    assert {row.name for row in rows} <= {one.name for one in (output / ASIDE).rglob("*.json")}
    for table, content in tables.items():
        assert content in (table.read_bytes(), aside.get(table.name))


def test_a_row_removes_nothing_but_tables_of_a_batch(found: Found, tmp_path: Path) -> None:
    output, mine = tmp_path / "output", tmp_path / "mine.txt"
    search(found, output)
    mine.write_text("of somebody else")
    for row in output.glob("*/*.json"):
        entry = json.loads(read_note(row))
        entry["files"]["../mine.txt"] = {"size": 1, "time_ns": 1, "digest": ""}
        write_note(row, json.dumps(entry).encode())
    assert any("not batch tables" in fault for fault in search(found, output).damaged.values())
    assert mine.read_text() == "of somebody else"


def test_a_copied_archive_is_read_and_not_made_again(found: Found, tmp_path: Path) -> None:
    output = tmp_path / "output"
    search(found, output)
    for one in output.rglob("*.parquet"):
        os.utime(one, ns=(1, 1))
    again = search(found, output)
    assert (again.done_now, again.placed_now, again.damaged) == (0, 0, {})


def test_an_output_that_may_not_be_read_is_not_taken_for_damaged(
    found: Found, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from uavrt.analysis.archive.parquet import seals
    from uavrt.core.errors import RecordingError

    output = tmp_path / "output"
    search(found, output)

    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    before = sorted(output.rglob("*"))
    monkeypatch.setattr(seals, "read_note", refuse)
    monkeypatch.setattr("uavrt.analysis.archive.parquet.ledger.read_note", refuse)
    with pytest.raises(RecordingError, match=r"Permission denied.*access"):
        search(found, output)
    assert sorted(output.rglob("*")) == before


KEY = "0123456789abcdef"


def load(output: Path) -> dict[str, str]:
    return Ledger(output, DONE, RecordingRow, [PULSES]).damaged


def put(output: Path, name: str, content: bytes) -> str:
    (output / name).parent.mkdir(exist_ok=True)
    (output / name).write_bytes(content)
    return name


def test_a_kill_after_the_row_was_set_aside_does_not_lose_its_tables(tmp_path: Path) -> None:
    row = put(tmp_path, f"{DONE}/{KEY}.json", b"{}")
    assert row in load(tmp_path)
    # Its table is still there, as after a kill at this moment.
    table = put(tmp_path, f"{PULSES}/{KEY}.parquet", b"pulses")
    assert table in load(tmp_path)
    assert (tmp_path / ASIDE / table).read_bytes() == b"pulses"
    assert load(tmp_path) == {}


def test_a_table_of_no_row_is_removed_where_every_row_can_be_read(tmp_path: Path) -> None:
    table = put(tmp_path, f"{PULSES}/{KEY}.parquet", b"pulses")
    assert load(tmp_path) == {table: "no finished recording or flight refers to it"}
    assert not (tmp_path / table).exists()
    assert not (tmp_path / ASIDE).exists()


def test_what_is_set_aside_replaces_nothing_that_was_set_aside_before(tmp_path: Path) -> None:
    contents = [b"{}", b"[]", b"3"]
    for content in contents:
        row = put(tmp_path, f"{DONE}/{KEY}.json", content)
        assert row in load(tmp_path)
    kept = sorted((tmp_path / ASIDE / DONE).iterdir())
    assert sorted(one.read_bytes() for one in kept) == sorted(contents)
    assert all(one.suffix == ".json" for one in kept)
