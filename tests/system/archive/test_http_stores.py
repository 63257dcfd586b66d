"""Recordings on a web server: the pulses of the file, and none lost when the line is cut."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from archived import CENTER_HZ, COLUMNS, RATE_HZ, START, TAGS, record
from http_store import Store, served

from uavrt.analysis.archive import object_stores as stores
from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.errors import FormatError, StoreError

pytest.importorskip("aiohttp", reason="fsspec[http] is not installed")
pq = pytest.importorskip("pyarrow.parquet")
SETTINGS = BatchSettings(cell_s=20.0, lead_in_s=8.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("archive")
    record(made / "walk.cf32", 45.0, 1, tags=TAGS[:1])
    (made / "readme.txt").write_text("no recording")
    return made


@pytest.fixture
def web(folder: Path) -> Iterator[tuple[Store, str]]:
    with served(folder) as both:
        yield both


def run(
    place: Path | str, name: str, work: Path, output: Path, workers: int = 1
) -> BatchSummary:
    manifest = work / "manifest.csv"
    manifest.write_text(f"{COLUMNS}\n{name},,{RATE_HZ},{CENTER_HZ},{START}\n")
    found = find_recordings([place], read_manifest(manifest))
    assert len(found.recordings) == 1
    return run_batch(
        found, TagSource(tags=TAGS[:1]), output, replace(SETTINGS, workers=workers)
    )


def starts(output: Path) -> list[tuple[int, float]]:
    rows = pq.read_table(output / "pulses").to_pylist()
    return [(row["start_time_ns"], row["snr_db"]) for row in rows]


@pytest.fixture(scope="module")
def reference(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> list[tuple[int, float]]:
    output = tmp_path_factory.mktemp("searched")
    run(folder, str(folder / "walk.cf32"), folder.parent, output)
    return starts(output)


def test_a_line_that_is_cut_in_the_middle_is_named_and_costs_nothing(
    web: tuple[Store, str],
    reference: list[tuple[int, float]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    store, address = web
    monkeypatch.setattr(stores, "BLOCK_BYTES", 1 << 20)  # the recording is short
    (url,) = (one.name for one in find_recordings([address]).recordings)
    assert url == f"{address}/walk.cf32"
    store.ends_at = round(31 * RATE_HZ * 8)
    first = run(address, url, tmp_path, tmp_path / "stored")
    (row,) = first.rows
    assert row.state == "failed"
    assert url in (row.fault or "")
    kept = sorted((tmp_path / "stored" / "unfinished").glob("*/*"))
    assert [one.name for one in kept] == ["0"]  # the cell before
    store.ends_at = None
    second = run(address, url, tmp_path, tmp_path / "stored")
    assert [one.state for one in second.rows] == ["done"]
    assert starts(tmp_path / "stored") == reference
    assert len(reference) >= 33


def test_two_workers_read_side_by_side(
    web: tuple[Store, str], reference: list[tuple[int, float]], tmp_path: Path
) -> None:
    _, address = web
    summary = run(address, f"{address}/walk.cf32", tmp_path, tmp_path / "stored", workers=2)
    assert [one.state for one in summary.rows] == ["done"]
    assert starts(tmp_path / "stored") == reference


def test_a_server_that_gives_only_whole_files_or_nothing_is_named(
    web: tuple[Store, str], tmp_path: Path
) -> None:
    store, address = web
    store.pieces = False
    summary = run(address, f"{address}/walk.cf32", tmp_path, tmp_path / "stored")
    (row,) = summary.rows
    assert row.state == "failed"
    assert "walk.cf32: the server cannot send parts of files" in (row.fault or "")
    store.pieces = True
    with pytest.raises(FormatError, match="nowhere"):
        find_recordings([f"{address}/nowhere.cf32"])


@pytest.mark.parametrize("length", ["", str(2**62)])
def test_a_server_that_does_not_tell_a_files_length_is_named(
    web: tuple[Store, str], length: str
) -> None:
    store, address = web
    store.length = length
    with pytest.raises(StoreError, match="reports no valid file size"):
        stores.open_stored(f"{address}/walk.cf32")


def test_lists_without_end_are_refused(web: tuple[Store, str]) -> None:
    store, address = web
    store.endless = True
    with pytest.raises(StoreError, match="too deeply nested folders"):
        stores.list_store(f"{address}/deep/")
