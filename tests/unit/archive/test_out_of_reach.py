"""What was done of a recording or flight stays while it cannot be reached."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from archived import TAGS, manifest, record, recorded_flight, write_flight

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import Found, find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary, BatchWatch
from uavrt.analysis.measure.tag_source import TagSource

SOUGHT = TagSource(tags=TAGS[:1])
OTHER_CELLS = BatchSettings(cell_s=70.0)


def found_in(folder: Path, name: str, place: Path | str | None = None) -> Found:
    return find_recordings([place or folder], read_manifest(manifest(folder, name)))


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
    flight = recorded_flight(folder)
    found = found_in(folder, "flight_a/iq/a.cf32")
    summary, told = run(found, output)
    assert (summary.done_now, summary.placed_now, told) == (1, 1, [])
    assert count(output) > 40
    assert count(output, "positions") == 1
    return flight, found, output


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
    write_flight(folder / "flight_a")
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
