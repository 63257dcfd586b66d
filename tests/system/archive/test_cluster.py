"""A batch on a Dask cluster: scheduler and workers are processes of their own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from archived import CENTER_HZ, COLUMNS, RATE_HZ, START, TAGS, record
from command_line import launched
from interrupted import interrupted
from until import until

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps import cluster
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary, BatchWatch
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.errors import LinkError, UsageError

WORKERS = 3


@dataclass(slots=True)
class Cluster:
    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler and three workers, on the loopback."""
    folder = tmp_path_factory.mktemp("dask")
    file, log = folder / "scheduler.json", (folder / "log").open("wb")

    def start(name: str, *more: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{name}", *more],
            stdout=log,
            stderr=log,
            cwd=folder,
            # As a nanny sets it, so that undoing it is done here too.
            env=os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"},
        )

    place = ("--host", "127.0.0.1", "--scheduler-file", str(file), "--no-dashboard")
    programs = [start("scheduler", *place, "--port", "0")]
    try:
        until(file.is_file, 60.0)
        how = ("--no-nanny", "--nthreads", "1", "--nworkers", "1")
        programs += [start("worker", *place, *how) for _ in range(WORKERS)]
        import distributed

        with distributed.Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(WORKERS, timeout=60)
            address = client.scheduler.address
        yield Cluster(address, programs[0], programs[1:])
    finally:
        for program in programs:
            program.kill()
            program.wait()
        log.close()


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("archive")
    record(folder / "walk.cf32", 60.0, 5, tags=TAGS[:1])
    (folder / "manifest.csv").write_text(
        f"{COLUMNS}\nwalk.cf32,,{RATE_HZ},{CENTER_HZ},{START}\n"
    )
    return folder


def run(
    archive: Path,
    output: Path,
    *,
    scheduler: str | None,
    on_done: Callable[[int], None] = lambda _amount: None,
) -> BatchSummary:
    settings = BatchSettings(cell_s=15.0, lead_in_s=6.0, scheduler=scheduler)
    found = find_recordings([archive], read_manifest(archive / "manifest.csv"))
    return run_batch(
        found, TagSource(tags=TAGS[:1]), output, settings, BatchWatch(on_done=on_done)
    )


def test_a_cluster_gives_the_same_bytes_also_when_two_of_three_workers_are_killed(
    archive: Path, running: Cluster, tmp_path: Path
) -> None:
    run(archive, tmp_path / "serial", scheduler=None)
    told: list[int] = []
    summary = run(archive, tmp_path / "three", scheduler=running.address, on_done=told.append)
    assert [row.state for row in summary.rows] == ["done"]
    read_s = 60.0 + 3 * 6.0
    assert sum(told) == pytest.approx(read_s * RATE_HZ, rel=1e-6)

    left = iter(running.workers[: WORKERS - 1])

    def kill_one(amount: int) -> None:
        if amount > 0 and (worker := next(left, None)) is not None:
            worker.send_signal(signal.SIGKILL)

    summary = run(archive, tmp_path / "killed", scheduler=running.address, on_done=kill_one)
    assert next(left, None) is None
    assert [row.state for row in summary.rows] == ["done"]
    serial, three, killed = (
        (next((tmp_path / name / "pulses").glob("*.parquet"))).read_bytes()
        for name in ("serial", "three", "killed")
    )
    assert pq.read_table(tmp_path / "serial" / "pulses").num_rows >= 45
    assert serial == three == killed


def test_a_scheduler_that_goes_is_named_and_what_was_done_stays(
    archive: Path, running: Cluster, tmp_path: Path
) -> None:
    def written() -> bool:
        return any((tmp_path / "unfinished").glob("*/*"))

    def end_it(_amount: int) -> None:
        if written():
            running.scheduler.kill()

    with pytest.raises(LinkError, match="scheduler is lost"):
        run(archive, tmp_path, scheduler=running.address, on_done=end_it)
    assert written()


def test_a_worker_of_a_run_that_has_ended_leaves_its_task(tmp_path: Path) -> None:
    path = tmp_path / "run"
    old, new = cluster.RunMarker(path, "old"), cluster.RunMarker(path, "new")
    old.write()
    assert not old.should_stop()
    new.write()
    assert not new.should_stop()
    assert cluster.RunMarker(path, "old").should_stop()
    path.unlink()
    assert cluster.RunMarker(path, "new").should_stop()


def test_a_scheduler_that_does_not_answer_is_named(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with pytest.raises(UsageError, match="no Dask scheduler answers at tcp://127"):
        run(archive, tmp_path, scheduler="tcp://127.0.0.1:9")


def test_a_scheduler_without_workers_is_named_and_ctrl_c_ends_the_wait(
    archive: Path, tmp_path: Path
) -> None:
    (archive / "tags.txt").write_text("2, 148706000, 1210, 20, 20, 10, 3, 0.02\n")
    file = tmp_path / "scheduler.json"
    lonely = launched(
        *("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"),
        *("--no-dashboard", "--scheduler-file", file),
        stdout=None,
        stderr=subprocess.DEVNULL,
    )
    try:
        until(file.is_file, 60.0)
        address = json.loads(file.read_text())["address"]
        batch = launched(
            *("-m", "uavrt.cli", "batch", archive, "--tags", archive / "tags.txt"),
            *("-o", tmp_path / "out", "--manifest", archive / "manifest.csv"),
            *("--scheduler", address),
            stdout=None,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        assert batch.stderr is not None
        said = next(line for line in batch.stderr if "no worker" in line)
        assert f"dask worker {address}" in said
        _, _, took_s = interrupted(batch)
        assert batch.returncode == 130
        assert took_s < 2.0
    finally:
        lonely.kill()
        lonely.wait()
