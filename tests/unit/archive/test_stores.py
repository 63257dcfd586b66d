"""Recordings in object stores give the same pulses as files, and lose none when one ends."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import fsspec
import pyarrow.parquet as pq
import pytest
from archived import CENTER_HZ, RATE_HZ, START, TAGS, manifest, record
from fsspec.implementations.memory import MemoryFile
from sigmf_meta import write_meta
from some import some

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.errors import FormatError, StoreError

SETTINGS = BatchSettings(cell_s=20.0, lead_in_s=8.0)


def end_at(patch: pytest.MonkeyPatch, place: int, *, breaks: bool) -> None:
    """Have all files of the store end at a place, or the line to them break."""
    whole = MemoryFile.readinto

    def readinto(file: MemoryFile, buffer: memoryview) -> int:
        if file.tell() + len(buffer) <= place:
            return int(whole(file, buffer))
        if breaks:
            raise ConnectionResetError("the line was cut")
        return 0

    patch.setattr(MemoryFile, "readinto", readinto)


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("local")
    record(folder / "walk.cf32", 45.0, 1, tags=TAGS[:1])
    return folder


@pytest.fixture
def store(local: Path) -> Iterator[str]:
    system = fsspec.filesystem("memory")
    system.pipe_file("/archive/walk.cf32", (local / "walk.cf32").read_bytes())
    system.pipe_file("/archive/readme.txt", b"no recording")
    yield "memory://archive"
    system.rm("/archive", recursive=True)


def run(paths: list[Path | str], recording: str, folder: Path, output: Path) -> BatchSummary:
    found = find_recordings(paths, read_manifest(manifest(folder, recording)))
    assert len(found.recordings) == 1
    return run_batch(found, TagSource(tags=TAGS[:1]), output, SETTINGS)


def starts(output: Path) -> list[tuple[int, float]]:
    rows = pq.read_table(output / "pulses").to_pylist()
    return [(row["start_time_ns"], row["snr_db"]) for row in rows]


@pytest.fixture(scope="module")
def reference(local: Path, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[int, float]]:
    output = tmp_path_factory.mktemp("searched")
    run([local], "walk.cf32", local, output)
    return starts(output)


def test_a_recording_in_a_store_gives_the_pulses_of_the_file(
    store: str, reference: list[tuple[int, float]], tmp_path: Path
) -> None:
    (url,) = (one.name for one in find_recordings([store]).recordings)
    summary = run([store], url, tmp_path, tmp_path / "stored")
    assert [(row.path, row.state) for row in summary.rows] == [(url, "done")]
    assert starts(tmp_path / "stored") == reference
    assert len(reference) >= 33
    # It is as it was: nothing is done again.
    again = run([store], url, tmp_path, tmp_path / "stored")
    assert (again.done_now, again.done_before) == (0, 1)


@pytest.mark.parametrize("breaks", [True, False])
def test_a_store_that_ends_in_the_middle_is_named_and_loses_nothing(
    store: str, reference: list[tuple[int, float]], tmp_path: Path, breaks: bool
) -> None:
    (url,) = (one.name for one in find_recordings([store]).recordings)
    with pytest.MonkeyPatch.context() as patch:
        end_at(patch, round(31 * RATE_HZ * 8), breaks=breaks)
        first = run([store], url, tmp_path, tmp_path / "stored")
    (row,) = first.rows
    assert row.state == "failed"
    said = "the line was cut" if breaks else "is truncated: it ends at byte"
    assert said in (row.fault or "")
    assert url in (row.fault or "")
    kept = sorted((tmp_path / "stored" / "unfinished").glob("*/*"))
    assert [one.name for one in kept] == ["0"]  # the cell before
    second = run([store], url, tmp_path, tmp_path / "stored")
    assert [one.state for one in second.rows] == ["done"]
    assert starts(tmp_path / "stored") == reference


def test_what_is_not_in_a_store_is_named(store: str) -> None:
    with pytest.raises((FormatError, StoreError), match="nowhere"):
        find_recordings([f"{store}/nowhere"])
    with pytest.raises(FormatError, match="no-such"):
        find_recordings(["no-such://bucket"])


def test_headers_in_a_store_are_read_as_those_of_files(tmp_path: Path) -> None:
    system = fsspec.filesystem("memory")
    record(tmp_path / "a.sigmf-data", 12.0, 1, tags=TAGS[:1])
    write_meta(tmp_path / "a", RATE_HZ, {"frequency": CENTER_HZ, "datetime": START})
    for ending in ("meta", "data"):
        system.pipe_file(
            f"/sigmf/a.sigmf-{ending}", (tmp_path / f"a.sigmf-{ending}").read_bytes()
        )
    (stored,) = find_recordings(["memory://sigmf"]).recordings
    (filed,) = find_recordings([tmp_path]).recordings
    with closing(stored.open()) as one, closing(filed.open()) as other:
        assert one.origin == other.origin
        assert replace(one.layout, path=tmp_path) == replace(other.layout, path=tmp_path)
        one.skip_to(40_000)
        other.skip_to(40_000)
        first, second = some(one.read()), some(other.read())
    assert first.time_ns == second.time_ns
    assert (first.samples == second.samples).all()
    system.rm("/sigmf", recursive=True)
