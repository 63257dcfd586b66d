"""What a foreign database may not define, however it is written."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from uavrt.flight.database.plain_database import LONGEST_DEFINITION, open_plain


@pytest.mark.parametrize(
    "made",
    [
        "CREATE TABLE odd (one, two GENERATED ALWAYS AS (zeroblob(9)))",
        'CREATE TABLE odd (one, "two"as(1)stored)',
        "CREATE TABLE odd (one, two/**/aS--\n(1))",
        "CREATE VIEW odd AS SELECT 1",
        "CREATE TRIGGER odd AFTER INSERT ON plain BEGIN SELECT 1; END",
        "CREATE VIRTUAL TABLE odd USING rtree(one, two, three)",
        f"CREATE TABLE odd (one DEFAULT '{LONGEST_DEFINITION * '.'}')",
    ],
)
def test_what_makes_more_values_than_are_stored_is_refused(tmp_path: Path, made: str) -> None:
    path = tmp_path / "flight.sqlite"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE plain (phase, as_flown, status DEFAULT 'as sent')")
        database.execute("CREATE INDEX by_phase ON plain (phase)")
    open_plain(path).close()
    with closing(sqlite3.connect(path)) as database:
        database.execute(made)
    with pytest.raises(sqlite3.DatabaseError, match="'odd"):
        open_plain(path)
