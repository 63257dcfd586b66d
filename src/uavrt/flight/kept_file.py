"""Store one record in a file so that it survives stops and restarts of the program.

A disk fault may lose the record, but it never stops the flight.
"""

from contextlib import suppress
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from uavrt.core.atomic_file import sync_to_disk, write_atomically
from uavrt.core.errors import FormatError
from uavrt.core.foreign import read_record
from uavrt.core.log import get_logger

log = get_logger()

R = TypeVar("R")


class KeptFile(Generic[R]):
    """A record that is stored in a file as readable JSON.

    The directory of `path` is created when needed. With `sync`, each `keep` waits for the disk;
    otherwise a power cut may lose half a minute of changes.
    """

    def __init__(self, path: Path, kind: type[R], name: str, *, sync: bool = True) -> None:
        self.path = path
        self._kind: type[R] = kind
        self._unread, self._unkept = f"{name} not read", f"{name} not stored; lost at a restart"
        self._sync = sync
        self._fault = ""

    def read(self) -> R | None:
        """Read the record; None if the file is missing or damaged.

        A damaged file is renamed with the suffix ``.damaged``.
        """
        try:
            return read_record(self.path, self._kind)
        except FileNotFoundError:
            return None
        except OSError as error:
            log.warning(self._unread, reason=str(error.strerror))
        except FormatError as error:
            log.warning(self._unread, reason=f"damaged: {error}")
            with suppress(OSError):
                self.path.replace(self.path.with_suffix(".damaged"))
        return None

    def keep(self, record: R) -> None:
        """Replace the stored record; a power cut leaves either the old or the new record."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            text = msgspec.json.format(msgspec.json.encode(record)).decode()
            write_atomically(self.path, text + "\n", sync=self._sync)
            self._fault = ""
        except OSError as error:
            self._complain(error)

    def remove(self) -> None:
        """Delete the file with the record."""
        try:
            self.path.unlink(missing_ok=True)
            sync_to_disk(self.path.parent)
        except OSError as error:
            self._complain(error)

    def _complain(self, error: OSError) -> None:
        if (fault := str(error.strerror)) != self._fault:
            log.warning(self._unkept, reason=fault)
        self._fault = fault
