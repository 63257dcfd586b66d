"""Copy rows of thousands of flights into one file per month, so that queries open few files.

::

    OUT/months/TABLE/2026-05-HASH.parquet   sorted by tag and time
    OUT/copies.json                         source files of each copy; also cached answers

A month with a missing source file is not used, and rows in no month are read from their
original files. Damaged monthly files are written again.
"""

import atexit
import hashlib
import os
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, TypeVar

import msgspec

from uavrt.analysis.archive.parquet.parquet_tables import (
    FLIGHTS,
    MONTHS,
    RECORDINGS,
    ROWS,
    SCHEMA_VERSION,
)
from uavrt.analysis.archive.parquet.seals import (
    FileFingerprint,
    fault_of,
    read_note,
    sealed,
    write_note,
)
from uavrt.core.atomic_file import make_directories, replacing
from uavrt.core.errors import FormatError, needs_extra
from uavrt.core.foreign import decode_record, require_plain_file
from uavrt.core.units import NANOSECONDS_PER_SECOND

if TYPE_CHECKING:
    import duckdb

T = TypeVar("T")
LEAST_FILES = 100
"""Number of new table files from which they are copied into monthly files; fewer are opened one
by one."""
_GROUP_ROWS = 50_000
_INTERRUPTED_S = 0.5
"""Longest wait for an interrupted query [s]; some steps of DuckDB ignore interrupts."""
INDEX = "copies.json"
UNKNOWN = "unknown"
"""Name used in place of the month, in a file name, for rows without a known time."""


class Copy(msgspec.Struct, frozen=True):
    """Index entry of a file with rows copied from other files, or a cached query result."""

    seal: FileFingerprint
    keys: list[str] = []  # a struct copies it
    """Names of the files whose rows were copied, without extension."""


Index = dict[str, Copy]
"""Index of the copies of tables by month, by path below the output."""


def gather_months(
    output: Path,
    index: Index,
    tables: Mapping[str, Mapping[str, int | None]],
    *,
    least_files: int = LEAST_FILES,
    lost: bool = False,
) -> Index:
    """Update the monthly files with newly written tables; return the new index.

    Fewer than `least_files` new files are not copied, unless monthly files were `lost`.
    """
    kept = dict(index)
    for table, times in tables.items():
        files: dict[str, list[str]] = defaultdict(list)
        for stem, time_ns in times.items():
            files[_month(time_ns)].append(stem)
        held = {name for name in index if name.startswith(_folder(table))}
        wanted = {_name(table, month, keys): sorted(keys) for month, keys in files.items()}
        fresh, stale = wanted.keys() - held, held - wanted.keys()
        many = sum(len(wanted[name]) for name in fresh) >= least_files
        if many or (lost and held) or (stale and not fresh):
            for name in fresh:
                kept[name] = _copy(output, table, name, wanted[name])
            for name in stale:
                del kept[name]
    return kept


def read_index(output: Path, *, thorough: bool = False) -> tuple[Index, dict[str, str]]:
    """Read the index of usable monthly files; for others return the fault by path.

    With `thorough` all monthly files are read; otherwise only their sizes and times are
    compared.
    """
    try:
        noted = decode_record(read_note(output / INDEX), Index)
    except FileNotFoundError:
        written = any((output / name).exists() for name in (RECORDINGS, FLIGHTS, ROWS))
        return {}, {INDEX: "missing"} if written else {}
    except FormatError:
        return {}, {INDEX: "the digest does not match the content"}
    faults = {
        name: fault
        for name, one in noted.items()
        if (fault := fault_of(output / name, one.seal, thorough=thorough)) is not None
    }
    return {name: one for name, one in noted.items() if name not in faults}, faults


def write_index(output: Path, index: Index) -> None:
    """Write the index of monthly files, and delete files not in it. Raises `OSError`."""
    write_note(output / INDEX, msgspec.json.encode(index))
    for folder, _, names in os.walk(output / MONTHS):
        for path in (Path(folder, name) for name in names):
            if path.relative_to(output).as_posix() not in index:
                path.unlink()


def _folder(table: str) -> str:
    return f"{MONTHS}/{table}/"


def _name(table: str, month: str, keys: list[str]) -> str:
    said = hashlib.sha256(" ".join(sorted(keys)).encode()).hexdigest()[:12]
    return f"{_folder(table)}{month}-{said}.parquet"


def in_duckdb(query: Callable[["duckdb.DuckDBPyConnection"], T], **limits: str) -> T:
    """Run a query on a new DuckDB connection that Ctrl-C can end at once.

    The query runs in another thread. DuckDB checks for signals only between the tasks of a
    query, which may take minutes.
    """
    with needs_extra("batch", "An archive"):
        import duckdb
    connections: list[duckdb.DuckDBPyConnection] = []
    answer: Future[T] = Future()

    def run() -> None:
        try:
            with duckdb.connect(config={**limits}) as connection:
                connections.append(connection)
                result = query(connection)
            answer.set_result(result)
        except BaseException as error:  # noqa: BLE001 - raised where it is waited for
            answer.set_exception(error)

    thread = Thread(target=run, name="duckdb", daemon=True)
    thread.start()
    try:
        return answer.result()
    finally:
        end_s = time.monotonic() + _INTERRUPTED_S
        while not answer.done() and time.monotonic() < end_s:
            with suppress(duckdb.Error):  # closed meanwhile
                for connection in connections:
                    connection.interrupt()
            wait([answer], 0.05)
        if not answer.done():
            atexit.register(_end_during_query, thread)


def _end_during_query(thread: Thread) -> None:
    """Exit the process at once if a query still runs; a normal exit crashes in DuckDB."""
    if thread.is_alive():
        sys.stdout.flush()
        os._exit(128 + signal.SIGINT)


def _copy(output: Path, table: str, name: str, keys: list[str]) -> Copy:
    """Write the rows of many files into one file, sorted by tag and time. DuckDB sorts on the
    disk if memory is short.
    """
    files = [output / table / f"{key}.parquet" for key in keys]
    target = output / name
    make_directories(target.parent)
    with replacing(target) as part:
        sql = (
            f"COPY (SELECT * FROM {rows_of(files)} ORDER BY tag_id, start_time_ns) "
            f"TO {quoted(part)} (FORMAT parquet, COMPRESSION zstd, "
            f"ROW_GROUP_SIZE {_GROUP_ROWS}, KV_METADATA {{uavrt_schema: '{SCHEMA_VERSION}'}})"
        )
        in_duckdb(lambda connection: connection.execute(sql).fetchall())
    return Copy(sealed(target), keys)


def source_of(output: Path, table: str) -> str | None:
    """SQL expression for all rows of a table; None if there are none."""
    try:
        with os.scandir(output / table) as entries:
            tables = [one for one in entries if one.name.endswith(".parquet")]
    except FileNotFoundError:
        return None
    for one in tables:
        if not one.is_file():  # a pipe would be waited for
            require_plain_file(one.path)
    there = {one.name.removesuffix(".parquet") for one in tables}
    index, _ = read_index(output)
    months = {
        name: one
        for name, one in index.items()
        if name.startswith(_folder(table)) and there.issuperset(one.keys)
    }
    held = {key for one in months.values() for key in one.keys}
    files = [output / name for name in months]
    files += [output / table / f"{key}.parquet" for key in there - held]
    return f"SELECT * FROM {rows_of(files)}" if files else None


def rows_of(files: list[Path]) -> str:
    """SQL expression that reads Parquet files, without columns for their folders' names."""
    listed = ", ".join(map(quoted, sorted(files)))
    return f"read_parquet([{listed}], hive_partitioning = false, union_by_name = true)"


def quoted(text: Path | str) -> str:
    """Quote a path or a name as an SQL string."""
    return "'" + str(text).replace("'", "''") + "'"


def _month(time_ns: int | None) -> str:
    if time_ns is None:
        return UNKNOWN
    return datetime.fromtimestamp(time_ns / NANOSECONDS_PER_SECOND, UTC).strftime("%Y-%m")
