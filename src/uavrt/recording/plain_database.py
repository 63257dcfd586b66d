"""Open flight databases of unknown origin safely.

A view in place of a table may never finish, SQLite waits for a pipe next to the database, and a
running query ignores Ctrl-C. A bad flight directory must affect only that flight.
"""

import os
import sqlite3
import stat
import threading
import time
from collections.abc import Callable
from pathlib import Path

STEPS = 50_000
"""Steps of SQLite's machine between two checks of the time: some milliseconds."""
LONGEST_VALUE_BYTES = 16_000_000
"""Limit of one value; the settings of a flight have some 10 kB."""
LONGEST_S = 120.0
"""Limit of one use of a database [s]; 100 000 pulses are read in one second."""
_SUFFIXES = ("", "-wal", "-shm", "-journal")
LONGEST_DEFINITION = 20_000
"""Limit of one table's definition [characters]; a default in it can fill every row."""
_ODD = (
    "SELECT name FROM sqlite_master WHERE type IN ('view', 'trigger') "
    f"OR sql LIKE 'CREATE VIRTUAL%' OR length(sql) > {LONGEST_DEFINITION} "
    "UNION ALL SELECT name FROM sqlite_master AS made WHERE type = 'table' "
    "AND EXISTS (SELECT 1 FROM pragma_table_xinfo(made.name) WHERE hidden > 1) LIMIT 1"
)
"""Finds definitions that make more values than the file holds: views, columns, defaults."""

ended = threading.Event()
"""Set when the program ends, which ends queries."""


def open_plain(path: Path, *, mode: str = "ro") -> sqlite3.Connection:
    """Open a database for reading; only tables are allowed, and queries end in time.

    With ``"rw"`` as `mode` SQLite may fold in its log: for a copy. Raises `sqlite3.Error` if it
    cannot be opened, is damaged, or is not one of ours.
    """
    require_plain_files(path)
    address = f"{path.absolute().as_uri()}?mode={mode}"
    database = sqlite3.connect(address, uri=True, timeout=5.0)
    try:
        watch(database)
        database.execute("PRAGMA trusted_schema=OFF")
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_VALUE_BYTES)
        odd = database.execute(_ODD).fetchone()
    except sqlite3.Error:
        database.close()
        raise
    if odd is not None:
        database.close()
        raise sqlite3.DatabaseError(f"{odd[0][:80]!r} in it is not a plain table")
    return database


def require_plain_files(path: Path) -> None:
    """Raise `sqlite3.DatabaseError` if a pipe, socket or device is in the place of a file."""
    for suffix in _SUFFIXES:
        try:
            mode = os.stat(f"{path}{suffix}").st_mode
        except OSError:
            continue
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise sqlite3.DatabaseError(f"{path.name}{suffix} is no file")


def watch(database: sqlite3.Connection, longest_s: float = LONGEST_S) -> None:
    """End queries after a time limit, when the program ends, and on Ctrl-C."""
    database.set_progress_handler(_watcher(time.thread_time() + longest_s), STEPS)


def _watcher(until_s: float) -> Callable[[], int]:
    """Use this thread's CPU time, so that a busy computer makes no query too long."""
    return lambda: int(ended.is_set() or time.thread_time() > until_s)
