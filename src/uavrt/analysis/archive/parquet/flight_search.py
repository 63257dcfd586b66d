"""Find flights of an archive by tag and day, in pages, for the ground station."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavrt.analysis.archive.parquet.months import quoted, source_of
from uavrt.analysis.archive.parquet.parquet_tables import PULSES, RECORDINGS
from uavrt.analysis.archive.parquet.questions import QUESTIONS, in_archive, kept_answer

if TYPE_CHECKING:
    import duckdb

_LIMITS = {"threads": "1", "memory_limit": "100MB", "temp_directory": ""}
"""DuckDB settings: one thread and 100 MB, so that queries do not delay the ground station's
reception of pulses.

10 million rows need 50 MB."""
_FLOWN = """
SELECT flight, min(path) AS path, min(start_time_ns) AS start_time_ns,
       max(start_time_ns + CAST(1e9 * (coalesce(length_s, 0)
           + coalesce(lost_samples / sample_rate_hz, 0)) AS BIGINT)) AS end_time_ns,
       sum(confirmed) AS pulses
FROM {recordings} GROUP BY flight
"""
_WANTED = """
CREATE TEMP TABLE wanted AS SELECT * FROM flown
WHERE ($since_ns IS NULL OR end_time_ns >= $since_ns)
  AND ($before_ns IS NULL OR start_time_ns < $before_ns)
  AND ($tag_id IS NULL OR flight IN (
       SELECT flight FROM heard WHERE tag_id = $tag_id AND confirmed > 0))
"""
_PAGE = """
SELECT flight, path, start_time_ns, end_time_ns, pulses FROM wanted
ORDER BY start_time_ns DESC NULLS LAST, flight LIMIT $limit OFFSET $after
"""
_HEARD = """
SELECT flight, tag_id, confirmed FROM heard
WHERE confirmed > 0 AND list_contains($flights, flight) ORDER BY flight, tag_id
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArchivedFlight:
    """A flight in an archive, with its received tags."""

    flight: str
    path: str
    """Path of the first recording, or of the flight directory if no recording was searched."""
    start_time_ns: int | None
    end_time_ns: int | None
    pulses: int
    heard: tuple[tuple[int, int], ...]
    """Number of confirmed pulses of each received tag, by tag id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundFlights:
    """One page of the flights found in an archive."""

    total: int
    flights: tuple[ArchivedFlight, ...]


def find_flights(
    archive: Path,
    *,
    tag_id: int | None = None,
    since_ns: int | None = None,
    before_ns: int | None = None,
    after: int = 0,
    limit: int = 100,
) -> FoundFlights:
    """Find flights in an archive, newest first.

    Parameters
    ----------
    archive : Path
        Directory that a batch wrote.
    tag_id : int, optional
        Only flights with confirmed pulses of this tag.
    since_ns, before_ns : int, optional
        Only flights that ended at or after `since_ns` and began before `before_ns` [ns, UTC].
    after, limit : int
        Number of flights to skip, and most to return.

    Raises
    ------
    FormatError
        No batch has written to `archive`, or a file is damaged.
    UsageError
        The extra ``uavrt[batch]`` is missing.
    """

    def query(connection: "duckdb.DuckDBPyConnection") -> tuple[int, list[Any], list[Any]]:
        _make_views(connection, archive)
        sought = {"since_ns": since_ns, "before_ns": before_ns, "tag_id": tag_id}
        connection.execute(_WANTED, sought)
        (total,) = connection.execute("SELECT count(*) FROM wanted").fetchall()[0]
        page = connection.execute(_PAGE, {"limit": limit, "after": after}).fetchall()
        named = {"flights": [row[0] for row in page]}
        return total, page, connection.execute(_HEARD, named).fetchall() if page else []

    total, page, counts = in_archive(archive, query, **_LIMITS)
    heard: dict[str, list[tuple[int, int]]] = {row[0]: [] for row in page}
    for flight, tag, count in counts:
        heard[flight].append((tag, count))
    flights = tuple(
        ArchivedFlight(
            flight=flight,
            path=path,
            start_time_ns=start_ns,
            end_time_ns=end_ns,
            pulses=int(pulses or 0),
            heard=tuple(heard[flight]),
        )
        for flight, path, start_ns, end_ns, pulses in page
    )
    return FoundFlights(total=total, flights=flights)


def _make_views(connection: "duckdb.DuckDBPyConnection", archive: Path) -> None:
    recordings = f"read_parquet({quoted(archive / RECORDINGS)})"
    connection.execute(f"CREATE VIEW flown AS {_FLOWN.format(recordings=recordings)}")
    if (kept := kept_answer(archive, "heard")) is not None:
        heard = f"SELECT * FROM read_parquet({quoted(kept)})"
    elif (pulses := source_of(archive, PULSES)) is not None:
        connection.execute(f"CREATE VIEW pulses AS {pulses}")
        heard = QUESTIONS["heard"]
    else:
        heard = "SELECT '' AS flight, 0 AS tag_id, 0 AS confirmed WHERE false"
    connection.execute(f"CREATE VIEW heard AS {heard}")
