"""SQLite files read, changed and made by hand."""

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any


def sql(place: Path | str, *statements: str, values: Sequence[Any] = ()) -> list[Any]:
    """Do statements in a database, or a flight's; the rows of the last, which takes values."""
    path = Path(place) / "flight.sqlite" if Path(place).is_dir() else place
    with closing(sqlite3.connect(path)) as database, database:
        for one in statements[:-1]:
            database.execute(one)
        return database.execute(statements[-1], values).fetchall()


def write_mbtiles(
    path: Path, facts: Mapping[str, object], tiles: Iterable[tuple[object, ...]]
) -> None:
    """Write a map: zoom, column, row and picture of each tile."""
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("CREATE TABLE metadata (name, value)")
        database.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)")
        database.executemany("INSERT INTO metadata VALUES (?, ?)", facts.items())
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", tiles)
