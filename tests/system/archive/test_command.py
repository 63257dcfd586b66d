"""``uavrt batch`` as it is started: stopped, killed, begun again."""

import os
import shutil
import signal
import subprocess
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from archived import TAGS as ARCHIVED
from archived import record
from command_line import launched, uavrt
from until import until

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.measure.tag_source import read_tag_source

TAGS = "2, 148706000, 1210, 20, 20, 10, 3, 0.005\n"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four minutes of noise and a tag, cut into cells of one minute by all that follows."""
    folder = tmp_path_factory.mktemp("archive")
    record(folder / "a.cf32", 240.0, 4, tags=ARCHIVED[:1])
    (folder / "manifest.csv").write_text(
        "path,sample_rate_hz,center_frequency_hz,start_time\n"
        "a.cf32,24000,148.7e6,2026-05-01T06:00:00Z\n"
    )
    (folder / "tags.txt").write_text(TAGS)
    return folder


def start(archive: Path, output: Path) -> subprocess.Popen[str]:
    return launched(
        *("-m", "uavrt.cli", "batch", archive, "--workers", "2", "-o", output),
        *("--tags", archive / "tags.txt", "--manifest", archive / "manifest.csv"),
        *("--cell", "60", "--lead-in", "20"),
        stdout=None,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def test_a_start_taken_from_the_files_date_is_told(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "manifest.csv").write_text(
        "path,sample_rate_hz,center_frequency_hz\nb.cf32,24000,148.7e6\n"
    )
    samples = (archive / "a.cf32").read_bytes()[: 8 * 24_000 * 10]
    (tmp_path / "b.cf32").write_bytes(samples)
    arguments = ["batch", str(tmp_path), "--tags", str(archive / "tags.txt"), "--workers", "1"]
    arguments += ["--manifest", str(tmp_path / "manifest.csv"), "-o", str(tmp_path / "out")]
    assert uavrt(*arguments) == 0
    said = capsys.readouterr().err
    assert "b.cf32: begun" in said
    assert "the date of the file, which copying may change: give start_time" in said


def cells(output: Path) -> int:
    """Number of cells that are done, of a search that is not."""
    return len(list(output.glob("unfinished/*/[0-9]*")))


def ended_after_a_cell(
    program: subprocess.Popen[str], output: Path, end: Callable[[], object]
) -> str:
    """End a program when one more cell is done; what it said."""
    before = cells(output)
    until(lambda: cells(output) > before or program.poll() is not None, 100.0)
    with suppress(ProcessLookupError):
        end()
    return program.communicate(timeout=60)[1]


def test_a_batch_that_is_stopped_and_killed_gives_the_same_in_the_end(
    archive: Path, tmp_path: Path
) -> None:
    output = tmp_path / "searched"
    for _ in range(5):
        program = start(archive, output)
        # As Ctrl-C does: to all of the terminal.
        stop = partial(os.killpg, program.pid, signal.SIGINT)
        said = ended_after_a_cell(program, output, stop)
        again = start(archive, output)
        ended_after_a_cell(again, output, again.kill)
        if program.returncode and again.returncode:
            break
        shutil.rmtree(output)  # a busy test came when all was done
    assert (program.returncode, again.returncode) == (130, -signal.SIGKILL)
    assert "continues from here" in said
    assert "Traceback" not in said

    sought = read_tag_source(archive / "tags.txt")
    found = find_recordings([archive], read_manifest(archive / "manifest.csv"))
    settings = BatchSettings(cell_s=60.0, lead_in_s=20.0, workers=1)
    summary = run_batch(found, sought, output, settings)
    assert (summary.done_now, summary.done_before) == (1, 0)
    run_batch(found, sought, tmp_path / "serial", settings)
    searched, serial = (pq.read_table(one / "pulses") for one in (output, tmp_path / "serial"))
    assert searched.num_rows > 190
    assert searched.equals(serial)
