"""What was done of a recording or flight stays while it cannot be reached."""

import shutil
from dataclasses import replace
from pathlib import Path

import fsspec
import pytest
from archived import CENTER_HZ, COLUMNS, RATE_HZ, START, TAGS, heard_amplitude, record
from archived import write_flight as write_turned
from command_line import uavrt
from http_store import served

from uavrt.analysis.measure import TagSource
from uavrt.batch import (
    BatchSettings,
    BatchSummary,
    BatchWatch,
    Found,
    ask,
    find_recordings,
    read_manifest,
    run_batch,
    stores,
)

SOUGHT = TagSource(tags=TAGS[:1])
OTHER_CELLS = BatchSettings(cell_s=70.0)


def found_in(folder: Path, name: str, place: Path | str | None = None) -> Found:
    manifest = folder / "manifest.csv"
    manifest.write_text(f"{COLUMNS}\n{name},,{RATE_HZ},{CENTER_HZ},{START}\n")
    return find_recordings([place or folder], read_manifest(manifest))


def count(output: Path, table: str = "pulses") -> int:
    (number,) = ask(output, f"select count(*) as n from {table}")["n"].to_pylist()
    return int(number)


def run(
    found: Found, output: Path, settings: BatchSettings | None = None
) -> tuple[BatchSummary, list[str]]:
    told: list[str] = []
    watch = BatchWatch(on_kept=lambda name, fault: told.append(f"{name}: {fault}"))
    return run_batch(found, SOUGHT, output, settings or BatchSettings(), watch), told


@pytest.fixture
def flown(tmp_path: Path) -> tuple[Path, Found, Path]:
    """A flight with a recording, as it was searched; what was found; and the tables."""
    folder, output = tmp_path / "archive", tmp_path / "searched"
    flight = write_turned(folder / "flight_a")
    (flight / "iq").mkdir(exist_ok=True)
    record(flight / "iq" / "a.cf32", 90.0, 1, tags=TAGS[:1], amplitude=heard_amplitude)
    found = found_in(folder, "flight_a/iq/a.cf32")
    summary, told = run(found, output)
    assert (summary.done_now, summary.placed_now, told) == (1, 1, [])
    assert count(output) > 40
    assert count(output, "positions") == 1
    return flight, found, output


def test_a_store_that_is_away_takes_no_pulse_along(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("aiohttp", reason="fsspec[http] is not installed")
    web, output = tmp_path / "web", tmp_path / "searched"
    web.mkdir()
    record(web / "walk.cf32", 30.0, 1, tags=TAGS[:1])
    (tmp_path / "tags.txt").write_text("2, 148706000, 1210, 20, 20, 10, 3, 0.02\n")
    nothing = tmp_path / "local"
    nothing.mkdir()
    with served(web) as (_, address):
        url = f"{address}/walk.cf32"
        found_in(tmp_path, url, nothing)
        command = (
            *("batch", str(nothing), "--tags", str(tmp_path / "tags.txt"), "--workers", "1"),
            *("--manifest", str(tmp_path / "manifest.csv"), "-o", str(output)),
        )
        assert uavrt(*command) == 0
        before = count(output)
        assert before > 20
    # Another run knows nothing of the lines that this one opened.
    fsspec.filesystem("http").clear_instance_cache()
    stores._opened.cache_clear()
    capsys.readouterr()
    assert uavrt(*command) == 1
    said = capsys.readouterr().err
    assert f"{url}: kept from before: not reachable now:" in said
    assert "1 kept from before" in said
    assert count(output) == before
    assert ask(output, "select state from recordings")["state"].to_pylist() == ["done"]
    # The same with other settings, of which nothing is done yet.
    assert uavrt(*command, "--cell", "70") == 1
    assert count(output) == before


def test_a_recording_that_cannot_be_reached_keeps_its_pulses_and_its_flight(
    flown: tuple[Path, Found, Path],
) -> None:
    flight, found, output = flown
    before = count(output)
    (flight / "iq" / "a.cf32").rename(flight / "iq" / "away")
    for settings in (BatchSettings(), OTHER_CELLS):
        summary, (told,) = run(found, output, settings)
        assert "a.cf32: " in told
        assert (summary.kept, summary.placed_now, summary.placed_before) == (1, 0, 1)
        assert [row.state for row in summary.rows] == ["done"]
        assert count(output) == before
        assert count(output, "positions") == 1
    (flight / "iq" / "away").rename(flight / "iq" / "a.cf32")
    summary, told_then = run(found, output, OTHER_CELLS)
    assert (summary.kept, summary.done_now, told_then) == (0, 1, [])
    assert [row.state for row in summary.rows] == ["done"]


def test_a_flight_whose_recording_was_taken_away_is_placed_by_what_was_searched(
    flown: tuple[Path, Found, Path],
) -> None:
    flight, _, output = flown
    before = count(output)
    (flight / "iq" / "a.cf32").unlink()
    summary, _ = run(find_recordings([flight.parent]), output)
    assert (summary.placed_now, summary.placed_before) == (0, 1)
    assert [row.state for row in summary.rows] == ["done"]
    assert (count(output), count(output, "positions")) == (before, 1)


def test_a_flight_that_cannot_be_reached_keeps_its_positions(
    flown: tuple[Path, Found, Path],
) -> None:
    flight, found, output = flown
    flight.rename(flight.with_name("away"))
    antenna = replace(BatchSettings().placing, antenna="H3")
    for settings in (BatchSettings(), BatchSettings(placing=antenna)):
        summary, told = run(found, output, settings)
        assert len(told) == summary.kept == 2
        assert [row.state for row in summary.flights] == ["done"]
        assert count(output, "positions") == 1


def test_what_was_never_done_and_is_away_has_failed(tmp_path: Path) -> None:
    folder = tmp_path / "archive"
    write_turned(folder / "flight_a")
    record(folder / "a.cf32", 15.0, 1, tags=TAGS[:1])
    found = found_in(folder, "a.cf32")
    shutil.move(folder, tmp_path / "away")
    summary, told = run(found, tmp_path / "searched")
    assert (summary.kept, told) == (0, [])
    assert [row.state for row in summary.rows] == ["failed"]
    assert [row.state for row in summary.flights] == ["failed"]


def test_a_recording_that_was_broken_since_has_failed(tmp_path: Path) -> None:
    folder, output = tmp_path / "archive", tmp_path / "searched"
    folder.mkdir()
    record(folder / "a.cf32", 15.0, 1, tags=TAGS[:1])
    found = found_in(folder, "a.cf32")
    run(found, output)
    (folder / "a.cf32").write_bytes(b"")
    summary, told = run(found, output)
    assert (summary.kept, told) == (0, [])
    assert [row.state for row in summary.rows] == ["failed"]
    assert count(output) == 0
