"""Record which pulses a ground station's directory holds, for receipts after a restart.

``received.bin`` begins with 8 bytes, a random number that identifies the store. An 8-byte hash
of each pulse's payload follows, written after the pulse itself. A directory without this file
is a new store, and the drone sends it the whole flight.
"""

import errno
import secrets
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from uavrt.core.errors import RecordingError
from uavrt.core.runtime.disk_thread import Disk, DiskBatches, at_once
from uavrt.ground.link.delivery_receipts import Receipts

RECEIVED_NAME = "received.bin"
_NUMBER = struct.Struct("<Q")
_Entry = tuple[int, Callable[[], None]]
"""Hash of a pulse's payload, and the function to call once the hash is on disk."""
_FULL = (errno.ENOSPC, errno.EDQUOT)


def new_store() -> int:
    """Draw the random number by which the drone recognises a new, empty store."""
    return 1 + secrets.randbelow(2**32 - 1)


def open_receipts(directory: Path, disk: Disk = at_once) -> Receipts:
    """Open the record of received pulses in a directory; `disk` runs the writes. On a full
    disk, hashes wait in memory; after a restart, those pulses are sent again.
    """
    path = directory / RECEIVED_NAME
    content = b""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as file:
            file.seek(0)
            content = file.read()
    except OSError as error:
        if error.errno not in _FULL:
            raise RecordingError(
                f"the record of received pulses cannot be saved in {directory}: "
                f"{error.strerror}",
                remedy="Give a writable directory with -o",
            ) from error
    numbers = [number for (number,) in _NUMBER.iter_unpack(content[: _whole(len(content))])]
    store = numbers[0] & 0xFFFFFFFF if numbers else 0
    new = not store  # no file, or zeros after a power cut: drones refuse receipts of store 0
    received = _Received(path, 0 if new else _whole(len(content)))
    if new:
        store = new_store()
        received.append([(store, lambda: None)])
    batches = DiskBatches(disk, received.append, _kept)
    return Receipts(store, numbers[1:], keep=lambda *one: batches.add(one))


def _kept(numbers: list[_Entry], _: None) -> None:
    for _number, then in numbers:
        then()


def _whole(size: int) -> int:
    return size - size % _NUMBER.size


class _Received:
    """File of pulse hashes; hashes that a full disk refuses wait in memory."""

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size
        self._waiting = b""

    def append(self, numbers: list[_Entry]) -> None:
        """Append hashes after the last complete one; an incomplete hash is overwritten."""
        self._waiting += b"".join(_NUMBER.pack(number) for number, _ in numbers)
        with suppress(OSError):
            # Not buffered: a receipt that was sent must be here after a kill.
            with open(self._path, "r+b" if self._size else "wb", buffering=0) as file:
                file.seek(self._size)
                written = _whole(file.write(self._waiting))
            self._size += written
            self._waiting = self._waiting[written:]
