"""An archive of years: questions over 10 million pulses, and cores side by side.

Bars: `tags` in 1 s, a filter by tag and day in .3 s; two cores at 80 % of twice one, Dask at
75 %; 200 MB for each worker.
"""

import os
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.bench_page import pss_mb
from benchmarks.harness import Table
from uavrt.analysis.archive.parquet.flight_search import find_flights
from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.months import gather_months, write_index
from uavrt.analysis.archive.parquet.parquet_tables import (
    DONE,
    PULSES,
    RECORDINGS,
    RecordingRow,
    schema_of,
    write_rows,
)
from uavrt.analysis.archive.parquet.questions import QUESTIONS, ask, keep_answers
from uavrt.analysis.archive.parquet.seals import sealed
from uavrt.core.messages import FlightInfo, Pulse, Tag
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.ground.store.known_flights import FlightChoice
from uavrt.ground.store.stored_flights import FlightLibrary

FLIGHTS, PULSES_EACH, TAGS, DAYS = 5000, 2000, 40, 1096
START_NS, DAY_NS = 1_577_836_800 * 10**9, 86_400 * 10**9
ROUNDS = 7
RATE_HZ, CENTER_HZ, LENGTH_S, FILES = 3_000_000, 148.7e6, 60, 8


def run() -> list[Table]:
    """All tables of this section."""
    with tempfile.TemporaryDirectory() as name:
        questions, lists = _questions(Path(name)), _lists(Path(name))
    with tempfile.TemporaryDirectory() as name:
        return [questions, lists, _cores(Path(name))]


def _questions(output: Path) -> Table:
    ledger = write_archive(output)
    day_ns = START_NS + 500 * DAY_NS
    asked = {
        "uavrt archive tags": (QUESTIONS["tags"], 1.0),
        "one tag, one day": (
            "select * from pulses where tag_id = 8 and start_time_ns >= "
            f"{day_ns} and start_time_ns < {day_ns + DAY_NS}",
            0.3,
        ),
        "pulses of one flight": ("select * from pulses where flight = 'flight_02500'", None),
        "pulses of each tag and month": (
            "select tag_id, date_trunc('month', start_utc) as month, "
            "count(*) from pulses group by all",
            None,
        ),
    }
    apart = {name: _seconds(output, sql, 1) for name, (sql, _) in asked.items()}
    started_s = time.process_time()
    index = gather_months(output, {}, {PULSES: ledger.times(PULSES)})
    write_index(output, index)
    spent_s = time.process_time() - started_s
    lines = []
    once_s = _seconds(output, QUESTIONS["tags"], ROUNDS)
    write_index(output, keep_answers(output, index))
    for name, (sql, bar_s) in asked.items():
        took_s = _seconds(output, sql, ROUNDS)
        met = (
            "" if bar_s is None else f"≤ {bar_s:g} s: {'met' if took_s <= bar_s else 'NOT met'}"
        )
        lines.append([name, f"{apart[name]:.2f} s", f"{took_s:.2f} s", met])
    return Table(
        title=f"Questions over {FLIGHTS * PULSES_EACH // 10**6} million pulses",
        header=["question", "a file for each flight", "by month", "bar"],
        rows=lines,
        notes=[
            f"{FLIGHTS} synthetic flights of {PULSES_EACH} pulses in {DAYS} days, {TAGS} tags; "
            f"gathering {len(index)} months took {spent_s:.0f} s of CPU. Time on the clock, "
            f"median of {ROUNDS} by month, two threads, files in the page cache.",
            f"A batch keeps the answer to `tags` until a pulse changes; to compute it takes "
            f"{once_s:.2f} s.",
        ],
    )


def _lists(archive: Path) -> Table:
    """What the page's *Flights* asks: the archive of `_questions`, and as many flights here."""
    here = archive / "here"
    _write_library(here)
    started_s = time.process_time()
    FlightLibrary(here).summaries()
    first_s = time.process_time() - started_s
    library = FlightLibrary(here)
    since_ns = START_NS + 500 * DAY_NS
    day = FlightChoice(tag_id=8, since_ns=since_ns, before_ns=since_ns + DAY_NS)
    asked: dict[str, Callable[[], int]] = {
        "this computer, newest": lambda: library.find(FlightChoice(), 0, 25)[0],
        "this computer, one tag and day": lambda: library.find(day, 0, 25)[0],
        "archive, newest": lambda: find_flights(archive, limit=20).total,
        "archive, one tag and day": lambda: (
            find_flights(archive, limit=20, **asdict(day)).total
        ),
    }
    rows = []
    for name, ask_for in asked.items():
        found, times_s = ask_for(), []
        for _ in range(ROUNDS):
            started_s = time.process_time()
            ask_for()
            times_s.append(time.process_time() - started_s)
        rows.append([name, f"{found}", f"{1e3 * statistics.median(times_s):.0f} ms"])
    return Table(
        title="Flights on the page",
        header=["list", "flights", "CPU"],
        rows=rows,
        notes=[
            f"{FLIGHTS} flights on this computer (copies of one that is empty), and those of "
            f"the archive above. CPU for an answer, median of {ROUNDS}. The first look at all "
            f"databases, took {first_s:.1f} s of CPU."
        ],
    )


def _write_library(directory: Path) -> None:
    """Flights as a ground station keeps them, of one tag each."""
    directory.mkdir()
    for number in range(FLIGHTS):
        start_ns = START_NS + number * DAYS * DAY_NS // FLIGHTS
        place = directory / f"flight_{number:05d}"
        if number == 0:
            tag = Tag(
                tag_id=2, frequency_hz=CENTER_HZ, pulse_width_s=0.02, pulse_intervals_s=(1.2,)
            )
            info = FlightInfo(
                directory=str(place),
                start_time_ns=start_ns,
                clock_offset_ns=0,
                center_frequency_hz=CENTER_HZ,
                sample_rate_hz=RATE_HZ,
                tags=(tag,),
            )
            FlightRecorder.create(info).close()
            first = (place / "flight.sqlite").read_bytes()
            continue
        place.mkdir()
        (place / "flight.sqlite").write_bytes(first)
        with closing(sqlite3.connect(place / "flight.sqlite")) as database:
            database.execute("PRAGMA synchronous = OFF")
            database.execute("UPDATE flight SET start_time_ns = ?", [start_ns])
            database.execute("UPDATE tags SET tag_id = ?", [2 + 2 * (number % TAGS)])
            database.commit()


@dataclass(frozen=True, slots=True)
class _Spent:
    wall_s: float
    cpu_s: float
    worker_mb: float
    """Most that a worker had, proportional."""


def _cores(folder: Path) -> Table:
    archive = folder / "archive"
    _record(archive)
    one = _batch(archive, folder / "one", "--workers", "1")
    two = _batch(archive, folder / "two", "--workers", "2")
    with _dask(folder, 2) as (address, programs):
        cluster = _batch(archive, folder / "dask", "--scheduler", address, others=programs)
    signal_s = LENGTH_S * FILES
    rows = []
    for name, spent, workers, bar in (
        ("one process", one, 1, 0.0),
        ("two processes", two, 2, 0.8),
        ("Dask, two workers with nannies", cluster, 2, 0.75),
    ):
        by_clock, by_cpu = one.wall_s / spent.wall_s / workers, one.cpu_s / spent.cpu_s
        verdict = "met" if spent.worker_mb <= 200.0 else "NOT met"
        told = f"≤ 200 MB: {verdict}"
        if bar:
            for name_of, share in (("clock", by_clock), ("CPU", by_cpu)):
                verdict = "met" if share >= bar else "NOT met"
                told += f"; ≥ {bar:.0%} of the {name_of}: {verdict}"
        rows.append(
            [
                name,
                f"{signal_s / spent.wall_s:.0f} ×",
                f"{spent.cpu_s:.1f} s",
                f"{by_clock:.0%}",
                f"{by_cpu:.0%}",
                f"{spent.worker_mb:.0f} MB",
                told,
            ]
        )
    return Table(
        title="Cores side by side",
        header=["", "real time", "CPU", "of the clock", "of the CPU", "a worker", "bar"],
        rows=rows,
        notes=[
            f"`uavrt batch` over {FILES} recordings of {LENGTH_S} s at 3 MS/s, 16 bit, 10 "
            "tags, in the page cache, start and writing included. Of the clock: time of one "
            "process over time times workers. Of the CPU: CPU of one process over that of "
            "all. PSS, the most of any worker; one process writes too. The clock counts on "
            "two idle cores alone: with other work beside, see the CPU."
        ],
    )


def _record(folder: Path) -> None:
    """One recording under several names: hard links, so that all are in the page cache."""
    folder.mkdir()
    rng, block_s = np.random.default_rng(3), 6
    count = block_s * RATE_HZ
    block = 60.0 * rng.standard_normal(2 * count, np.float32)
    samples = block.view(np.complex64)
    tags = []
    for number in range(10):
        offset_hz, width = -100e3 + 20e3 * number, round(0.02 * RATE_HZ)
        tags.append(
            f"{2 * number + 2}, {CENTER_HZ + offset_hz:.0f}, 1200, 20, 20, 10, 3, 0.005"
        )
        tone = 20.0 * np.exp(2j * np.pi * offset_hz / RATE_HZ * np.arange(width))
        for beep in range(5):
            first = round((0.1 * number + 1.2 * beep) * RATE_HZ)
            samples[first : first + width] += tone.astype(np.complex64)
    data = np.clip(block, -32767, 32767).astype("<i2").tobytes()
    with (folder / "0.cs16").open("wb") as file:
        for _ in range(LENGTH_S // block_s):
            file.write(data)
    lines = ["path,format,sample_rate_hz,center_frequency_hz,start_time"]
    for number in range(FILES):
        if number:
            os.link(folder / "0.cs16", folder / f"{number}.cs16")
        lines.append(f"{number}.cs16,,{RATE_HZ},{CENTER_HZ},2026-05-01T{number:02d}:00:00Z")
    (folder / "manifest.csv").write_text("\n".join(lines) + "\n")
    (folder / "tags.txt").write_text("\n".join(tags) + "\n")


def _batch(
    archive: Path, output: Path, *how: str, others: Sequence[subprocess.Popen[bytes]] = ()
) -> _Spent:
    before_s = sum(map(_tree_cpu_s, (one.pid for one in others)))
    started_s = time.perf_counter()
    program = subprocess.Popen(
        [
            *(sys.executable, "-m", "uavrt.cli", "batch", str(archive), *how),
            *("--tags", str(archive / "tags.txt"), "-o", str(output)),
            *("--manifest", str(archive / "manifest.csv")),
        ],
        stderr=subprocess.DEVNULL,
    )
    most_mb = 0.0
    while (ended := os.wait4(program.pid, os.WNOHANG))[0] == 0:
        roots = [one.pid for one in others] if others else [program.pid]
        trees = [pid for root in roots for pid in _tree(root)]
        workers = [pid for pid in trees if pid not in roots] or trees
        for worker in workers:
            with suppress(OSError):  # it has just ended
                most_mb = max(most_mb, pss_mb(worker))
        time.sleep(0.3)
    wall_s = time.perf_counter() - started_s
    program.returncode = os.waitstatus_to_exitcode(ended[1])
    assert program.returncode == 0, how
    cpu_s = ended[2].ru_utime + ended[2].ru_stime
    cpu_s += sum(map(_tree_cpu_s, (one.pid for one in others))) - before_s
    return _Spent(wall_s, cpu_s, most_mb)


def _tree(pid: int) -> list[int]:
    """A process and all below it."""
    # Each thread's children: a nanny starts its worker from one of its own.
    below = []
    for thread in Path(f"/proc/{pid}/task").glob("*"):
        with suppress(OSError):
            below += (thread / "children").read_text().split()
    return [pid, *(each for child in below for each in _tree(int(child)))]


def _tree_cpu_s(pid: int) -> float:
    ticks = 0
    for each in _tree(pid):
        fields = Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


@contextmanager
def _dask(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    file = folder / "scheduler.json"

    def start(name: str, *more: str) -> subprocess.Popen[bytes]:
        place = ("--host", "127.0.0.1", "--scheduler-file", str(file), "--no-dashboard")
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{name}", *place, *more],
            stderr=subprocess.DEVNULL,
            cwd=folder,
        )

    import distributed

    programs = [start("scheduler", "--port", "0")]
    try:
        while not file.is_file():
            time.sleep(0.1)
        programs.append(start("worker", "--nworkers", str(workers), "--nthreads", "1"))
        with distributed.Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
            address = client.scheduler.address
        yield address, programs
    finally:
        for program in reversed(programs):
            program.terminate()
            program.wait()


def _seconds(output: Path, sql: str, rounds: int) -> float:
    ask(output, sql)
    times = []
    for _ in range(rounds):
        started_s = time.perf_counter()
        ask(output, sql)
        times.append(time.perf_counter() - started_s)
    return statistics.median(times)


def write_archive(
    output: Path, flights: int = FLIGHTS, pulses_each: int = PULSES_EACH
) -> Ledger[RecordingRow]:
    """Write pulses of flights as a batch does, and the rows of their recordings."""
    rng = np.random.default_rng(1)
    ledger = Ledger(output, DONE, RecordingRow, [PULSES])
    for number in range(flights):
        flight = f"flight_{number:05d}"
        start_ns = (
            START_NS + number * DAYS // flights * DAY_NS + (6 + number % 7) * 3600 * 10**9
        )
        file = output / PULSES / f"key{number}.parquet"
        file.parent.mkdir(exist_ok=True)
        pq.write_table(_pulses(rng, flight, start_ns, pulses_each), file, compression="zstd")
        ledger.record(
            RecordingRow(
                path=f"/archive/{flight}.sigmf-meta",
                flight=flight,
                fingerprint=f"key{number}",
                state="done",
                fault=None,
                start_time_ns=start_ns,
                length_s=1800.0,
                sample_rate_hz=3e6,
                center_frequency_hz=148.7e6,
                pulses=pulses_each,
                confirmed=pulses_each,
                lost_samples=0,
                invalid_values=0,
                cells=1,
                cpu_s=20.0,
                finished_time_ns=start_ns,
                uavrt_version="0",
            ),
            {f"{PULSES}/{file.name}": sealed(file)},
        )
    write_rows(output / RECORDINGS, RecordingRow, ledger.rows)
    return ledger


def _pulses(rng: np.random.Generator, flight: str, start_ns: int, count: int) -> pa.Table:
    time_ns = start_ns + np.sort(rng.integers(0, 1800 * 10**9, count))
    tag = 2 * rng.integers(1, TAGS + 1, count)
    confirmed = rng.random(count) < 0.8
    columns = {
        "tag_id": tag,
        "frequency_hz": CENTER_HZ + 1e4 * tag + rng.normal(0.0, 20.0, count),
        "start_time_ns": time_ns,
        "end_time_ns": time_ns + 20_000_000,
        "snr_db": rng.normal(14.0, 4.0, count),
        "group_snr_db": rng.normal(14.0, 4.0, count),
        "score": 1.0 + rng.exponential(1.0, count),
        "group_index": rng.integers(1, 4, count),
        "group_sequence": np.arange(count) // 3,
        "noise_psd": rng.exponential(1e-9, count),
        "detection_status": np.where(confirmed, "confirmed", "unconfirmed"),
        "confirmed": confirmed,
        "rate": np.ones(count, np.int64),
        "predicted_next_start_ns": time_ns + 10**9,
        "predicted_next_end_ns": time_ns + 10**9 + 20_000_000,
        "also_possible_tag_ids": [[]] * count,
        "ghost_of_tag_id": [None] * count,
        "clipped": np.zeros(count, np.bool_),
        "burst_starts_ns": [()] * count,
        "burst_snrs_db": [()] * count,
        "recording": [f"/archive/{flight}.sigmf-meta"] * count,
        "cell": np.zeros(count, np.int32),
        "flight": [flight] * count,
        "start_utc": time_ns // 1000,
        "end_utc": (time_ns + 20_000_000) // 1000,
    }
    return pa.table(columns, schema=schema_of(Pulse, flight=True))
