"""What is done: a file for each recording or flight, so that a killed run keeps them all."""

import shutil
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from uavrt.batch.tables import MONTHS, FlightRow, RecordingRow, folder_of, old_folder_of
from uavrt.errors import RecordingError

DONE, PLACED = "done", "placed"

R = TypeVar("R", RecordingRow, FlightRow)


class Ledger(Generic[R]):
    """The rows of all recordings or flights; what a newer row replaces goes with its tables.

    Parameters
    ----------
    output : Path
        Directory of the tables.
    name : str
        Folder of the rows.
    record : type
        Of a row.
    tables : sequence of str
        What goes with a row.

    Raises
    ------
    RecordingError
        A row is damaged.
    OSError
        The directory cannot be written.
    """

    def __init__(self, output: Path, name: str, record: type[R], tables: Sequence[str]) -> None:
        self._output, self._directory, self._tables = output, output / name, tables
        self._rows: dict[str, R] = {}
        self._keys: dict[str, set[str]] = defaultdict(set)
        self._directory.mkdir(parents=True, exist_ok=True)
        for path in self._directory.glob("*.json"):
            try:
                self._note(msgspec.json.decode(path.read_bytes(), type=record))
            except (OSError, msgspec.DecodeError) as error:
                raise RecordingError(
                    f"{path} is damaged: {error}", remedy="Delete it: it is done anew"
                ) from error
        for row in self._rows.values():
            self._move(row.fingerprint, old_folder_of(row.flight), folder_of(row.flight))

    @property
    def rows(self) -> list[R]:
        """Get what was done so far, by path."""
        return sorted(self._rows.values(), key=lambda row: (row.path, row.finished_time_ns))

    def done(self, key: str) -> R | None:
        """Get the row of what is done under a key; what failed is not."""
        row = self._rows.get(key)
        return None if row is None or row.state == "failed" else row

    def of(self, path: str) -> R | None:
        """Get the row of what is done of a path, under whatever key."""
        done = filter(None, map(self.done, self._keys.get(path, ())))
        return max(done, key=lambda row: row.finished_time_ns, default=None)

    def settle(self, row: R) -> None:
        """Put a row down, and take away what it replaces.

        Raises
        ------
        OSError
            The directory cannot be written.
        """
        path = self._directory / f"{row.fingerprint}.json"
        part = path.with_suffix(".part")
        part.write_bytes(msgspec.json.encode(asdict(row)))
        part.replace(path)
        self._note(row)
        for old in self._keys[row.path] - {row.fingerprint}:
            self._remove(old)
        self._keys[row.path] = {row.fingerprint}

    def rename(self, row: R, flight: str) -> None:
        """Give a row's flight another name, in its tables, too.

        Raises
        ------
        OSError
            The directory cannot be written.
        """
        self._move(row.fingerprint, folder_of(row.flight), folder_of(flight))
        self.settle(replace(row, flight=flight))

    def hand_on(self, row: R, table: str, key: str) -> None:
        """Have another row keep what one has in a table.

        Raises
        ------
        OSError
            The directory cannot be written.
        """
        file = self._output / table / folder_of(row.flight) / f"{row.fingerprint}.parquet"
        if file.is_file():
            file.replace(file.with_name(f"{key}.parquet"))

    def rekey(self, row: R, key: str) -> None:
        """Keep all that a row has under another key.

        Raises
        ------
        OSError
            The directory cannot be written.
        """
        for table in self._tables:
            self.hand_on(row, table, key)
        self.settle(replace(row, fingerprint=key))

    def _move(self, key: str, old: str, new: str) -> None:
        """Move a row's tables from a folder to another."""
        if old == new:
            return
        for table in self._tables:
            before = self._output / table / old / f"{key}.parquet"
            if not before.is_file():
                continue
            # The copies by month hold the old name; they are made again.
            shutil.rmtree(self._output / MONTHS, ignore_errors=True)
            after = self._output / table / new / before.name
            after.parent.mkdir(parents=True, exist_ok=True)
            before.replace(after)
            with suppress(OSError):  # others are still in it
                before.parent.rmdir()

    def drop(self, path: str) -> None:
        """Take away what is known of a path."""
        for old in self._keys.pop(path, ()):
            self._remove(old)

    def _remove(self, key: str) -> None:
        for table in self._tables:
            for file in (self._output / table).glob(f"*/{key}.parquet"):
                file.unlink()
        (self._directory / f"{key}.json").unlink()
        del self._rows[key]

    def _note(self, row: R) -> None:
        self._rows[row.fingerprint] = row
        self._keys[row.path].add(row.fingerprint)
