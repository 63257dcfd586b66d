"""Record each finished recording and flight in a file of its own, so that a crash loses no
finished work.

A row is written after its tables have reached the disk, and contains their digests. So after a
crash or power cut every row has complete tables. Tables without a row are removed, and a row
without its tables is computed again.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from uavrt.analysis.archive.parquet.parquet_tables import FlightRow, RecordingRow
from uavrt.analysis.archive.parquet.seals import (
    FileFingerprint,
    fault_of,
    read_note,
    write_note,
)
from uavrt.core.atomic_file import is_part
from uavrt.core.errors import FormatError, RecordingError
from uavrt.core.foreign import decode_record

R = TypeVar("R", RecordingRow, FlightRow)
ASIDE = "damaged"
"""Folder below the output to which damaged row files and their tables are moved."""
_TABLE = re.compile(r"[0-9a-f]{16}\.parquet")
"""Pattern of a table's file name: its step's key (`step_keys`) and an extension."""


class _Entry(msgspec.Struct, frozen=True):
    row: msgspec.Raw
    files: dict[str, FileFingerprint]
    """Size, time and digest of each table of the row, by its path below the output."""


class Ledger(Generic[R]):
    """Rows of all finished recordings, or of all finished flights, and their tables. With
    `thorough`, tables are read and digests compared; otherwise sizes and times.
    """

    def __init__(
        self,
        output: Path,
        name: str,
        record: type[R],
        tables: Sequence[str],
        *,
        thorough: bool = False,
    ) -> None:
        self._output, self._directory, self._tables = output, output / name, tables
        self._record: type[R] = record
        self._rows: dict[str, R] = {}
        self._files: dict[str, dict[str, FileFingerprint]] = {}
        self._keys: dict[str, set[str]] = defaultdict(set)
        self.damaged: dict[str, str] = {}
        """Reason for each missing or damaged output file; its content is computed again."""
        self.withdrawn: set[str] = set()
        """Paths of row file and tables of each row removed because a table is damaged."""
        try:
            self._load(thorough=thorough)
        except PermissionError as error:
            raise RecordingError(
                f"{error.filename} cannot be read: {error.strerror}",
                remedy="Give this user access to the output, or run this as the output's owner",
            ) from error

    @property
    def rows(self) -> list[R]:
        """Rows of all finished work, in order of their paths."""
        return sorted(self._rows.values(), key=lambda row: (row.path, row.finished_time_ns))

    def done(self, key: str) -> R | None:
        """Return the row of successful work; `key` is a hash of its inputs. None if it failed
        or was not done.
        """
        row = self._rows.get(key)
        return None if row is None or row.state == "failed" else row

    def of(self, path: str) -> R | None:
        """Return the newest successful row of a recording or flight, whatever its settings;
        None if there is none.
        """
        done = filter(None, map(self.done, self._keys.get(path, ())))
        return max(done, key=lambda row: row.finished_time_ns, default=None)

    def files(self, key: str) -> dict[str, FileFingerprint]:
        """Size, time and digest of a row's table files, by path below the output."""
        return dict(self._files.get(key, {}))

    def times(self, table: str) -> dict[str, int | None]:
        """Start time [ns] of the data in each file of a table, by file name without suffix."""
        return {
            Path(name).stem: row.start_time_ns
            for key, row in self._rows.items()
            for name in self._files[key]
            if name.startswith(f"{table}/")
        }

    def record(self, row: R, files: Mapping[str, FileFingerprint] | None = None) -> None:
        """Store a row and its table `files`; remove the rows and tables that it replaces."""
        key, before = row.fingerprint, self.files(row.fingerprint)
        held = before if files is None else dict(files)
        entry = _Entry(row=msgspec.Raw(msgspec.json.encode(row)), files=held)
        write_note((self._output / self.place(key)), msgspec.json.encode(entry))
        self._note(row, held)
        for name in before.keys() - held.keys():
            (self._output / name).unlink(missing_ok=True)
        for old in self._keys[row.path] - {key}:
            self._remove(old, held)
        self._keys[row.path] = {key}

    def drop(self, path: str) -> None:
        """Remove all rows of a recording or flight, and their tables."""
        for old in self._keys.pop(path, ()):
            self._remove(old)

    def _load(self, *, thorough: bool) -> None:
        self._directory.mkdir(parents=True, exist_ok=True)
        for path in self._directory.iterdir():
            if path.suffix != ".json":
                if is_part(path):
                    path.unlink()
                continue
            try:
                entry = decode_record(read_note(path), _Entry)
                row = decode_record(entry.row, self._record)
                if row.fingerprint != path.stem:
                    raise FormatError(
                        "the entry describes another recording than its file name"
                    )
                # What is named here is removed with the row.
                if not all(map(self._is_table, entry.files)):
                    raise FormatError("the entry lists files that are not batch tables")
            except FormatError as error:
                self._discard(path, error.message)
                continue
            self._note(row, entry.files)
        for keys in list(self._keys.values()):
            # A cut came between a row and the removal of the one that it replaces.
            *older, newest = sorted(keys, key=lambda key: self._rows[key].finished_time_ns)
            for old in older:
                self._remove(old, self._files[newest])
                keys.remove(old)
        for key, files in list(self._files.items()):
            faults = dict(self._faults(files, thorough=thorough))
            if faults:
                self.damaged |= faults
                self.withdrawn.add(self.place(key))
                self.withdrawn.update(files)
                self._keys[self._rows[key].path].discard(key)
                self._remove(key)
        self._remove_strays()

    def _faults(
        self, files: Mapping[str, FileFingerprint], *, thorough: bool
    ) -> Iterator[tuple[str, str]]:
        for name, seal in files.items():
            if (fault := fault_of(self._output / name, seal, thorough=thorough)) is not None:
                yield name, fault

    def _remove_strays(self) -> None:
        """Remove tables that belong to no row, unless damaged rows were moved aside.

        If this run or an interrupted one moved damaged rows aside, the tables may belong to
        them and are not removed. Files of other programs are never removed.
        """
        unreadable = (self._output / ASIDE / self._directory.name).exists()
        known = {name for held in self._files.values() for name in held}
        for table in self._tables:
            for path in (self._output / table).glob("*"):
                if is_part(path):
                    path.unlink()
                elif _TABLE.fullmatch(path.name) and f"{table}/{path.name}" not in known:
                    self._discard(
                        path, "no finished recording or flight refers to it", keeps=unreadable
                    )

    def _is_table(self, name: str) -> bool:
        folder, _, file = name.partition("/")
        return folder in self._tables and _TABLE.fullmatch(file) is not None

    def _discard(self, path: Path, fault: str, *, keeps: bool = True) -> None:
        self.damaged.setdefault(path.relative_to(self._output).as_posix(), fault)
        if not keeps:
            path.unlink()
            return
        folder = self._output / ASIDE / path.parent.name
        folder.mkdir(parents=True, exist_ok=True)
        names = chain([path.name], (f"{path.stem}-{n}{path.suffix}" for n in count(2)))
        path.replace(next(folder / one for one in names if not (folder / one).exists()))

    def place(self, key: str) -> str:
        """Path of a row's file, relative to the output."""
        return f"{self._directory.name}/{key}.json"

    def _remove(self, key: str, kept: Mapping[str, FileFingerprint] | None = None) -> None:
        (self._output / self.place(key)).unlink(missing_ok=True)
        for name in self._files.pop(key).keys() - (kept or {}).keys():
            with suppress(FileNotFoundError):
                (self._output / name).unlink()
        del self._rows[key]

    def _note(self, row: R, files: Mapping[str, FileFingerprint]) -> None:
        self._rows[row.fingerprint] = row
        self._files[row.fingerprint] = dict(files)
        self._keys[row.path].add(row.fingerprint)
