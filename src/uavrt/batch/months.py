"""The rows of thousands of flights in a file for each month, so that questions open few files.

::

    OUT/months/TABLE/2026-05-HASH.parquet   by tag and time
    OUT/months/TABLE/index.json             which keys are in which file

They are copies: a month with a row that was replaced since is passed over, and what is in no
month is read where it was written.
"""

import hashlib
import os
from collections import defaultdict
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from uavrt.batch.ledger import DONE, PLACED
from uavrt.batch.tables import (
    MONTHS,
    PULSES,
    SCHEMA_VERSION,
    TABLES,
    FlightRow,
    RecordingRow,
    folder_of,
)
from uavrt.errors import needs_extra
from uavrt.units import NANOSECONDS_PER_SECOND

LEAST_FILES = 100
"""Fewer files than this are opened one by one."""
_GROUP_ROWS = 50_000
_INDEX = "index.json"
UNKNOWN, EMPTY = "unknown", "empty"
"""In place of a month: no time is known; nothing was found, so that there is no file."""


class _Month(msgspec.Struct, frozen=True):
    file: str
    keys: list[str]


def gather_months(
    output: Path,
    recordings: list[RecordingRow],
    flights: list[FlightRow],
    *,
    least_files: int = LEAST_FILES,
) -> int:
    """Bring the months up to date with what was written.

    Parameters
    ----------
    output : Path
        Directory of the tables.
    recordings, flights : list
        All rows.
    least_files : int
        Fewer files than this, that no month holds, are left as they are.

    Returns
    -------
    int
        How many months were written.

    Raises
    ------
    OSError
        The directory cannot be written.
    """
    written = 0
    for table in TABLES:
        files: dict[str, dict[str, Path]] = defaultdict(dict)
        for row in recordings if table == PULSES else flights:
            file = output / table / folder_of(row.flight) / f"{row.fingerprint}.parquet"
            month = _month(row.start_time_ns) if file.is_file() else EMPTY
            files[month][row.fingerprint] = file
        written += _gather(output / MONTHS / table, files, least_files)
    return written


def _gather(folder: Path, files: Mapping[str, Mapping[str, Path]], least_files: int) -> int:
    index = _read(folder)
    changed = {
        month: held
        for month, held in files.items()
        if month not in index or set(index[month].keys) != set(held)
    }
    stale = index.keys() - files.keys()
    if not stale and sum(map(len, changed.values())) < least_files:
        return 0
    folder.mkdir(parents=True, exist_ok=True)
    kept = {month: one for month, one in index.items() if month in files}
    for month, held in changed.items():
        keys = sorted(held)
        if month == EMPTY:
            kept[month] = _Month("", keys)
            continue
        name = f"{month}-{hashlib.sha256(' '.join(keys).encode()).hexdigest()[:12]}.parquet"
        _copy([held[key] for key in keys], folder / name)
        kept[month] = _Month(name, keys)
    part = folder / "index.part"
    part.write_bytes(msgspec.json.encode(kept))
    part.replace(folder / _INDEX)
    used = {one.file for one in kept.values()}
    for old in folder.glob("*.parquet"):
        if old.name not in used:
            old.unlink()
    return len(changed)


def _copy(files: list[Path], target: Path) -> None:
    """Write the rows of many files into one; DuckDB sorts them on the disk if need be."""
    with needs_extra("batch", "An archive"):
        import duckdb
    part = target.with_suffix(".part")
    with duckdb.connect() as connection:
        connection.execute(
            f"COPY (SELECT * FROM {rows_of(files)} ORDER BY tag_id, start_time_ns) "
            f"TO {quoted(part)} (FORMAT parquet, COMPRESSION zstd, "
            f"ROW_GROUP_SIZE {_GROUP_ROWS}, KV_METADATA {{uavrt_schema: '{SCHEMA_VERSION}'}})"
        )
    part.replace(target)


def source_of(output: Path, table: str) -> str | None:
    """Say where DuckDB finds all rows of a table; None where there are none."""
    folder = output / MONTHS / table
    ledger = output / (DONE if table == PULSES else PLACED)
    known = (
        {name.removesuffix(".json") for name in os.listdir(ledger)}
        if ledger.is_dir()
        else set()
    )
    months = [one for one in _read(folder).values() if known.issuperset(one.keys)]
    held = {key for one in months for key in one.keys}
    sources = []
    if whole := [quoted(folder / one.file) for one in months if one.file]:
        sources.append(f"read_parquet([{', '.join(whole)}])")
    if not months or known - held:
        loose = [file for file in (output / table).glob("*/*.parquet") if file.stem not in held]
        sources += [rows_of(loose)] if loose else []
    if not sources:
        return None
    return " UNION ALL BY NAME ".join(f"SELECT * FROM {one}" for one in sources)


def rows_of(files: list[Path]) -> str:
    """Have DuckDB read files of folders that are named by flights."""
    # The name of a flight may look like a number.
    how = "hive_partitioning = true, hive_types = {'flight': 'VARCHAR'}"
    return f"read_parquet([{', '.join(map(quoted, sorted(files)))}], {how})"


def quoted(text: Path | str) -> str:
    """Write a path or a name as a word of SQL."""
    return "'" + str(text).replace("'", "''") + "'"


def _read(folder: Path) -> dict[str, _Month]:
    """Read which keys are where; nothing from a damaged index: it is a copy."""
    try:
        return msgspec.json.decode((folder / _INDEX).read_bytes(), type=dict[str, _Month])
    except (OSError, msgspec.DecodeError):
        return {}


def _month(time_ns: int | None) -> str:
    if time_ns is None:
        return UNKNOWN
    return datetime.fromtimestamp(time_ns / NANOSECONDS_PER_SECOND, UTC).strftime("%Y-%m")
