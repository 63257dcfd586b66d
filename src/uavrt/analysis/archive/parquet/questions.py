"""Run SQL queries on an archive's Parquet tables, with DuckDB."""

import hashlib
from collections.abc import Callable
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, TypeVar

from uavrt.analysis.archive.parquet.months import (
    Copy,
    Index,
    in_duckdb,
    quoted,
    read_index,
    source_of,
)
from uavrt.analysis.archive.parquet.parquet_tables import (
    FLIGHTS,
    MONTHS,
    PULSES,
    RECORDINGS,
    SCHEMA_VERSION,
    TABLES,
    FlightRow,
    RecordingRow,
    schema_of,
)
from uavrt.analysis.archive.parquet.seals import sealed
from uavrt.core.atomic_file import replacing
from uavrt.core.errors import FormatError, UsageError, needs_extra

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

T = TypeVar("T")
QUESTIONS = {
    "list": """
SELECT flight, path, state, start_utc, length_s, pulses,
       confirmed, fault
FROM recordings ORDER BY start_time_ns, path
""",
    "tags": """
SELECT tag_id, count(*) AS pulses, count(*) FILTER (confirmed) AS confirmed,
       count(DISTINCT flight) AS flights,
       min(start_utc) AS first_utc,
       max(start_utc) AS last_utc,
       median(snr_db) FILTER (confirmed) AS median_snr_db,
       median(frequency_hz) FILTER (confirmed) AS median_frequency_hz
FROM pulses GROUP BY tag_id ORDER BY tag_id
""",
    "heard": """
SELECT flight, tag_id, count(*) AS pulses, count(*) FILTER (confirmed) AS confirmed,
       min(start_utc) AS first_utc,
       max(start_utc) AS last_utc
FROM pulses GROUP BY flight, tag_id ORDER BY tag_id, flight
""",
}
"""Predefined SQL queries on an archive, by name."""
KEPT = ("tags", "heard")
"""Names of the predefined queries that read every pulse; a batch caches their results."""


def ask(archive: Path, question: str) -> "pa.Table":
    """Run an SQL query on an archive; returns an Arrow table.

    Parameters
    ----------
    archive : Path
        Directory that a batch wrote.
    question : str
        Query on the tables `recordings`, `flights`, `pulses`, `poses`, `bearings` and
        `positions`; `QUESTIONS` has predefined ones.

    Raises
    ------
    FormatError
        No batch has written there, or a file is damaged.
    UsageError
        The query is wrong, or the extra ``uavrt[batch]`` is missing.
    """
    for name in KEPT:
        if question == QUESTIONS[name] and (kept := kept_answer(archive, name)) is not None:
            question = f"SELECT * FROM read_parquet({quoted(kept)})"

    def query(connection: "duckdb.DuckDBPyConnection") -> "pa.Table":
        _make_views(connection, archive, question)
        answer = connection.sql(question)
        if answer is None:
            raise UsageError("this is not an SQL query", remedy="Begin the query with SELECT")
        return _in_utc(answer.to_arrow_table())

    return in_archive(archive, query)


def _in_utc(answer: "pa.Table") -> "pa.Table":
    """Set the time zone of time columns to UTC, since DuckDB sets it to the computer's zone."""
    import pyarrow as pa

    columns = []
    for field in answer.schema:
        zoned = pa.types.is_timestamp(field.type) and field.type.tz is not None
        kind = pa.timestamp(field.type.unit, "UTC") if zoned else field.type
        columns.append(field.with_type(kind))
    return answer.cast(pa.schema(columns, metadata=answer.schema.metadata))


def check_archive(archive: Path) -> None:
    """Raise `FormatError` for a directory to which no batch has written."""
    if not (archive / RECORDINGS).is_file():
        raise FormatError(
            f"{archive} contains no {RECORDINGS}",
            remedy="Name the directory that uavrt batch wrote with -o",
        )


def in_archive(
    archive: Path, query: Callable[["duckdb.DuckDBPyConnection"], T], **limits: str
) -> T:
    """Call `query` with a DuckDB connection to an archive; convert errors to uavrt's."""
    with needs_extra("batch", "An archive"):
        import duckdb
    check_archive(archive)
    recordings = quoted(archive / RECORDINGS)
    size = f"SELECT num_rows, file_size_bytes FROM parquet_file_metadata({recordings})"

    def checked(connection: "duckdb.DuckDBPyConnection") -> T:
        rows, size_bytes = connection.sql(size).fetchall()[0]
        if rows > size_bytes:  # a batch writes the path of each
            raise FormatError(
                f"{archive / RECORDINGS} is damaged: {rows:,} rows without columns; run the "
                "same uavrt batch again with --verify"
            )
        return query(connection)

    try:
        return in_duckdb(checked, **limits)
    except duckdb.OutOfMemoryException as error:
        most = limits.get("memory_limit", "this computer has")
        raise FormatError(
            f"{archive}: this query needs more memory than {most}",
            remedy="Query fewer flights or columns with uavrt archive query",
        ) from error
    except (duckdb.IOException, duckdb.InvalidInputException) as error:
        text, _, _ = str(error).partition("\n")
        denied = "Permission denied" in text
        raise FormatError(
            f"{archive}: {text}",
            remedy="Give this user access to the archive"
            if denied
            else "Run the same uavrt batch again with --verify, which writes damaged files "
            "again",
        ) from error
    except duckdb.Error as error:
        raise UsageError(
            str(error), remedy=f"Available tables: recordings, flights, {', '.join(TABLES)}"
        ) from error


def keep_answers(archive: Path, index: Index) -> Index:
    """Cache slow queries' results until a pulse table changes; return the new index."""
    import pyarrow.parquet as pq

    if not any(name.startswith(f"{MONTHS}/{PULSES}/") for name in index):
        return index
    kept = {name: one for name, one in index.items() if PurePath(name).parent.name != MONTHS}
    for name in KEPT:
        place = _place(archive, name)
        if place in index:
            kept[place] = index[place]
            continue
        answer = ask(archive, QUESTIONS[name])
        with replacing(archive / place) as part:
            pq.write_table(answer, part)
        kept[place] = Copy(sealed(archive / place))
    return kept


def kept_answer(archive: Path, name: str) -> Path | None:
    """Path of the cached result of a query in `KEPT`; None if there is none for the present
    pulse tables.
    """
    place = _place(archive, name)
    return archive / place if place in read_index(archive)[0] else None


def _place(archive: Path, name: str) -> str:
    """Path of a cached result below the archive, with a hash of the pulse files in its name."""
    whole = archive.absolute()
    said = f"{source_of(whole, PULSES)} {SCHEMA_VERSION}".replace(str(whole), "")
    state = hashlib.sha256(said.encode()).hexdigest()[:16]
    return f"{MONTHS}/{name}-{state}.parquet"


def _make_views(connection: "duckdb.DuckDBPyConnection", archive: Path, question: str) -> None:
    """Create a view for each table in a query; listing the files of all would take long."""
    asked = question.lower()
    whole: dict[str, type] = {RECORDINGS: RecordingRow, FLIGHTS: FlightRow}
    for file, record in whole.items():
        if (archive / file).is_file():
            source = f"SELECT * FROM read_parquet({quoted(archive / file)})"
            connection.execute(f"CREATE VIEW {Path(file).stem} AS {source}")
        else:
            connection.register(Path(file).stem, schema_of(record).empty_table())
    for table, record in TABLES.items():
        if table not in asked:
            continue
        if (rows := source_of(archive, table)) is not None:
            connection.execute(f"CREATE VIEW {table} AS {rows}")
        else:
            connection.register(table, schema_of(record, flight=True).empty_table())
