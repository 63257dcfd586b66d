"""Open flight databases of unknown origin without the risk that they block the program.

In a malicious or damaged database, a view in place of a table may compute endlessly. If the log
file is a pipe, SQLite waits for it forever. A running query ignores Ctrl-C. This module
prevents all three.
"""

import os
import re
import sqlite3
import stat
import threading
import time
from functools import lru_cache
from pathlib import Path

STEPS = 50_000
"""Number of steps of SQLite's virtual machine between two checks of the time limit; these steps
take some milliseconds."""
LONGEST_VALUE_BYTES = 16_000_000
"""Maximum size of a value in a database [bytes]; a flight's settings have about 10 kB."""
LONGEST_S = 120.0
"""Maximum CPU time of all queries on one open database [s]; reading 100 000 pulses takes 1
s."""
_SUFFIXES = ("", "-wal", "-shm", "-journal")
LONGEST_DEFINITION = 20_000
"""Maximum length of a table's SQL definition [characters], which may contain long default
values."""
_COMPUTED = re.compile(r"(?<![a-z_])as(?![a-z_])", re.IGNORECASE)
"""Pattern that matches every SQL definition of a table with a generated column."""

queries_ended = threading.Event()
"""Event that is set when the program ends; it interrupts all queries."""


def open_plain(path: Path, *, mode: str = "ro") -> sqlite3.Connection:
    """Open a database for reading, with a time limit; views and computed columns are refused.

    With `mode` ``"rw"``, SQLite may checkpoint the write-ahead log; use this mode only for a
    copy.
    """
    require_plain_files(path)
    address = f"{path.absolute().as_uri()}?mode={mode}"
    database = sqlite3.connect(address, uri=True, timeout=5.0)
    try:
        limit_queries(database)
        database.execute("PRAGMA trusted_schema=OFF")
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_VALUE_BYTES)
        odd = _odd_name(database)
    except sqlite3.Error:
        database.close()
        raise
    if odd is not None:
        database.close()
        raise sqlite3.DatabaseError(f"{odd[:80]!r} in the database is not a plain table")
    return database


def _odd_name(database: sqlite3.Connection) -> str | None:
    """Name of a view, a generated column or a long default in a database; else None."""
    made = "SELECT name, type, sql FROM sqlite_master WHERE sql IS NOT NULL"
    hidden = "SELECT 1 FROM pragma_table_xinfo(?) WHERE hidden > 1"
    for name, kind, text in database.execute(made):
        if (
            kind in ("view", "trigger")
            or text.upper().startswith("CREATE VIRTUAL")
            or len(text) > LONGEST_DEFINITION
            or (_may_compute(text) and database.execute(hidden, (name,)).fetchone())
        ):
            return str(name)
    return None


@lru_cache(maxsize=64)
def _may_compute(definition: str) -> bool:
    """True if a table with this SQL definition may have a generated column; cached."""
    return _COMPUTED.search(definition) is not None


def require_plain_files(path: Path) -> None:
    """Raise `sqlite3.DatabaseError` if a database file is a pipe, socket or device."""
    for suffix in _SUFFIXES:
        try:
            mode = os.stat(f"{path}{suffix}").st_mode
        except OSError:
            continue
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise sqlite3.DatabaseError(f"{path.name}{suffix} is not a file")


def limit_queries(database: sqlite3.Connection, longest_s: float = LONGEST_S) -> None:
    """End queries at a limit of CPU time, at the end of the program, and on Ctrl-C.

    The limit applies to the CPU time of this thread, so queries do not end early on a busy
    computer.
    """
    until_s = time.thread_time() + longest_s
    database.set_progress_handler(
        lambda: int(queries_ended.is_set() or time.thread_time() > until_s), STEPS
    )
