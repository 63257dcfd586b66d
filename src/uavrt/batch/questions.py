"""Questions over all that a batch has written, in SQL, by DuckDB on its Parquet."""

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.batch.months import MONTHS, quoted, source_of
from uavrt.batch.tables import (
    FLIGHTS,
    PULSES,
    RECORDINGS,
    SCHEMA_VERSION,
    TABLES,
    FlightRow,
    RecordingRow,
    schema_of,
)
from uavrt.errors import FormatError, UsageError, needs_extra

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

QUESTIONS = {
    "list": """
SELECT flight, path, state, make_timestamp_ns(start_time_ns) AS start_utc, length_s, pulses,
       confirmed, fault
FROM recordings ORDER BY start_time_ns, path
""",
    "tags": """
SELECT tag_id, count(*) AS pulses, count(*) FILTER (confirmed) AS confirmed,
       count(DISTINCT flight) AS flights,
       make_timestamp_ns(min(start_time_ns)) AS first_utc,
       make_timestamp_ns(max(start_time_ns)) AS last_utc,
       median(snr_db) FILTER (confirmed) AS median_snr_db,
       median(frequency_hz) FILTER (confirmed) AS median_frequency_hz
FROM pulses GROUP BY tag_id ORDER BY tag_id
""",
}
"""Ready ones, by name."""


def ask(archive: Path, question: str) -> "pa.Table":
    """Answer a question in SQL as an Arrow table.

    Parameters
    ----------
    archive : Path
        Directory that a batch wrote.
    question : str
        Over the tables `recordings`, `flights`, `pulses`, `poses`, `bearings` and `positions`;
        `QUESTIONS` has ready ones.

    Raises
    ------
    FormatError
        No batch has written there, or a file is damaged.
    UsageError
        The question is wrong, or the extra is missing.
    """
    with needs_extra("batch", "An archive"):
        import duckdb
    if not (archive / RECORDINGS).is_file():
        raise FormatError(
            f"{archive} holds no {RECORDINGS}",
            remedy="Name the directory that uavrt batch wrote with -o",
        )
    if question == QUESTIONS["tags"] and (kept := _kept(archive)) is not None:
        return kept
    try:
        with duckdb.connect() as connection:
            _make_views(connection, archive, question)
            answer = connection.sql(question)
            if answer is None:
                raise UsageError("that is no question", remedy="Begin it with SELECT")
            return answer.to_arrow_table()
    except (duckdb.IOException, duckdb.InvalidInputException) as error:
        raise FormatError(
            f"{archive}: {error}",
            remedy="Delete the damaged file and its row in done/, and run uavrt batch again",
        ) from error
    except duckdb.Error as error:
        raise UsageError(
            str(error),
            remedy=f"The tables are recordings, flights, {', '.join(TABLES)}",
        ) from error


def keep_answers(archive: Path) -> None:
    """Keep the answer that looks at every pulse, for as long as no pulse changes.

    Raises
    ------
    OSError
        The directory cannot be written.
    """
    if not (archive / MONTHS / PULSES).is_dir():
        return
    import pyarrow.parquet as pq

    answer = ask(archive, QUESTIONS["tags"]).replace_schema_metadata({"of": _state(archive)})
    part = archive / MONTHS / "tags.part"
    pq.write_table(answer, part)
    part.replace(archive / MONTHS / "tags.parquet")


def _kept(archive: Path) -> "pa.Table | None":
    """The answer that was kept, if it is of these pulses."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        kept = pq.read_table(archive / MONTHS / "tags.parquet")
    except (OSError, pa.ArrowException):
        return None
    if (kept.schema.metadata or {}).get(b"of") != _state(archive).encode():
        return None
    return kept.replace_schema_metadata()


def _state(archive: Path) -> str:
    """Name the files of all pulses: those of months are named by what they hold."""
    said = f"{source_of(archive, PULSES)} {SCHEMA_VERSION}".replace(str(archive), "")
    return hashlib.sha256(said.encode()).hexdigest()


def _make_views(connection: "duckdb.DuckDBPyConnection", archive: Path, question: str) -> None:
    """Make the tables that a question may mean: to list those of thousands takes time."""
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
