"""A batch gives the same pulses whoever computes them, and whatever happens meanwhile."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from archived import CENTER_HZ, RATE_HZ, START_NS, TAGS, manifest, record
from gapped import write_gapped

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.flight_search import find_flights
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary, BatchWatch
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.errors import FormatError, RecordingError
from uavrt.flight.database.writer_lock import WriterLock

SOUGHT = TagSource(tags=TAGS)
SETTINGS = BatchSettings(cell_s=30.0, lead_in_s=10.0)


@pytest.fixture(name="archive", scope="module")
def archive_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("archive")
    for number, length_s in enumerate((75.0, 35.0)):
        record(folder / f"walk_{number}.cf32", length_s, number)
    manifest(folder, "walk_0.cf32", "walk_1.cf32")
    return folder


def run(
    archive: Path,
    output: Path,
    settings: BatchSettings = SETTINGS,
    *,
    sought: TagSource = SOUGHT,
    should_stop: Callable[[], bool] = lambda: False,
    on_samples: Callable[[int], None] = lambda _count: None,
) -> BatchSummary:
    return run_batch(
        find_recordings([archive], read_manifest(archive / "manifest.csv")),
        sought,
        output,
        settings,
        BatchWatch(should_stop=should_stop, on_done=on_samples),
    )


def pulses(output: Path) -> pa.Table:
    return pq.read_table(output / "pulses")


@pytest.fixture(name="reference", scope="module")
def reference_fixture(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> pa.Table:
    output = tmp_path_factory.mktemp("serial")
    summary = run(archive, output)
    assert [(row.state, row.cells) for row in summary.rows] == [("done", 3), ("done", 2)]
    return pulses(output)


def test_every_pulse_is_there_once_also_where_the_recording_is_cut(reference: pa.Table) -> None:
    found = reference.to_pylist()
    for tag in TAGS:
        for flight, length_s in (("walk_0", 75.0), ("walk_1", 35.0)):
            of_tag = [p for p in found if p["tag_id"] == tag.tag_id and p["flight"] == flight]
            times_s = np.array([p["start_time_ns"] for p in of_tag]) / 1e9
            beats = np.rint((times_s - times_s[0]) / tag.pulse_intervals_s[0])
            assert len(set(beats)) == len(beats)
            # The last one may be cut off by the recording's end.
            assert len(beats) >= int(length_s / tag.pulse_intervals_s[0]) - 1


def test_a_run_that_is_stopped_goes_on_where_it_was(
    archive: Path, reference: pa.Table, tmp_path: Path
) -> None:
    done = [0]

    def count(samples: int) -> None:
        done[0] += samples

    first = run(archive, tmp_path, should_stop=lambda: done[0] > 50 * RATE_HZ, on_samples=count)
    assert first.stopped
    assert first.done_now == 0
    again: list[int] = []
    second = run(archive, tmp_path, on_samples=again.append)
    assert second.done_now == 2
    # The first cell is not done again; three others read 10 s before their own time.
    assert sum(again) == (75.0 + 35.0 - 30.0 + 3 * 10.0) * RATE_HZ
    assert pulses(tmp_path).equals(reference)
    third = run(archive, tmp_path)
    assert (third.done_now, third.done_before) == (0, 2)


def test_what_was_changed_is_done_anew_and_nothing_else(archive: Path, tmp_path: Path) -> None:
    folder, output = tmp_path / "archive", tmp_path / "output"
    folder.mkdir()
    for name in ("walk_0.cf32", "walk_1.cf32"):
        record(folder / name, 32.0, 9)
    (folder / "manifest.csv").write_text((archive / "manifest.csv").read_text())
    run(folder, output)
    record(folder / "walk_1.cf32", 35.0, 1)
    second = run(folder, output)
    assert (second.done_now, second.done_before) == (1, 1)
    assert [row.length_s for row in second.rows] == [32.0, 35.0]
    # Other tags touch all; the old pulses are gone.
    third = run(folder, output, sought=TagSource(tags=TAGS[:1]))
    assert (third.done_now, third.done_before) == (2, 0)
    assert set(pulses(output)["tag_id"].to_pylist()) == {TAGS[0].tag_id}


def test_a_gap_is_counted_once_and_a_flight_ends_after_it(tmp_path: Path) -> None:
    folder, output = tmp_path / "archive", tmp_path / "output"
    folder.mkdir()
    record(tmp_path / "whole.cf32", 110.0, 5, tags=TAGS[:1])
    write_gapped(
        folder / "band",
        np.fromfile(tmp_path / "whole.cf32", np.complex64),
        rate_hz=RATE_HZ,
        center_hz=CENTER_HZ,
        start_ns=START_NS,
        # Its end is read twice: what the last cell reads before its own time begins there.
        gap_s=(25.0, 85.0),
        kind="right",
    )
    manifest(folder)
    (row,) = run(folder, output).rows
    assert (row.length_s, row.lost_samples, row.cells) == (50.0, round(60.0 * RATE_HZ), 3)
    (flight,) = find_flights(output).flights
    assert flight.end_time_ns == START_NS + 110 * 10**9
    starts_s = (pulses(output)["start_time_ns"].to_numpy() - START_NS) / 1e9
    interval_s = TAGS[0].pulse_intervals_s[0]
    assert np.abs(starts_s / interval_s - np.round(starts_s / interval_s)).max() < 0.01
    assert starts_s[starts_s > 84.0].size > 12


def test_a_broken_recording_is_named_and_the_others_are_done(tmp_path: Path) -> None:
    folder, output = tmp_path / "archive", tmp_path / "output"
    folder.mkdir()
    record(folder / "whole.cf32", 15.0, 1)
    record(folder / "cut.cf32", 15.0, 2)
    with (folder / "cut.cf32").open("ab") as file:
        file.write(b"\x00\x00\x00")
    (folder / "empty.cf32").touch()
    (folder / "broken.sigmf-meta").write_text("{")
    manifest(folder, "whole.cf32", "cut.cf32", "empty.cf32")
    summary = run(folder, output)
    said = {Path(row.path).name: (row.state, row.fault or "") for row in summary.rows}
    assert said["whole.cf32"] == ("done", "")
    assert said["cut.cf32"][0] == "truncated"
    assert "middle of a sample" in said["cut.cf32"][1]
    assert said["empty.cf32"][0] == said["broken.sigmf-meta"][0] == "failed"
    assert set(pulses(output)["recording"].to_pylist()) == {
        str(folder / "whole.cf32"),
        str(folder / "cut.cf32"),
    }
    about = pq.read_table(output / "recordings.parquet")
    assert about["state"].to_pylist().count("failed") == 2
    # What failed is tried again; what is done is not.
    again = run(folder, output)
    assert (again.done_now, again.done_before) == (2, 2)
    assert len(again.rows) == 4


def test_two_runs_at_one_output_refuse_each_other(archive: Path, tmp_path: Path) -> None:
    lock = WriterLock()
    assert lock.take(tmp_path, 0.0)
    with pytest.raises(RecordingError, match="another batch"):
        run(archive, tmp_path)
    lock.release()


def test_a_manifest_of_a_spreadsheet_begins_with_a_mark(tmp_path: Path) -> None:
    path = tmp_path / "manifest.csv"
    path.write_text("\ufeffpath\nmanifest.csv\n", encoding="utf-8")
    assert set(read_manifest(path)) == {path.resolve()}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"path\n{'x' * 200_000}\n", "field larger"),
        ("file\nwalk.cf32\n", "no column named path"),
        ("path,rate\nwalk.cf32,3\n", "column rate"),
        ("path\nnowhere.cf32\n", "nowhere.cf32 does not exist"),
        ("path,start_time\nmanifest.csv,yesterday\n", "line 2"),
        ("path,sample_rate_hz\nmanifest.csv,fast\n", "line 2"),
    ],
)
def test_a_wrong_manifest_is_named_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "manifest.csv").write_text(text)
    with pytest.raises(FormatError, match=says):
        read_manifest(tmp_path / "manifest.csv")
