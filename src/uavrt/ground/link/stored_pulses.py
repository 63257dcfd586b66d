"""Which pulses a ground station's directory holds, for receipts that survive a restart.

``received.bin`` stands beside the stored pulses: the store's number in its first 8 bytes, then
8 bytes for each pulse, its payload's hash, written after the pulse itself. A directory without
it is a new store, and the drone sends it the whole flight.
"""

import os
import secrets
import struct
from pathlib import Path

from uavrt.errors import RecordingError
from uavrt.ground.link.delivery_receipts import Receipts

RECEIVED_NAME = "received.bin"
_NUMBER = struct.Struct("<Q")


def new_store() -> int:
    """Number of an empty store."""
    return 1 + secrets.randbelow(2**32 - 1)


def open_receipts(directory: Path) -> Receipts:
    """Get the receipts of a directory.

    Raises
    ------
    RecordingError
        The directory cannot be read or written.
    """
    path = directory / RECEIVED_NAME
    try:
        directory.mkdir(parents=True, exist_ok=True)
        # Not buffered: a receipt that was sent must be here after a kill.
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        content = path.read_bytes()
        whole = len(content) - len(content) % _NUMBER.size
        os.truncate(file, whole)  # a power cut may leave half a number
        if whole == 0:
            store = new_store()
            os.write(file, _NUMBER.pack(store))
        else:
            store = _NUMBER.unpack_from(content)[0] & 0xFFFFFFFF
    except OSError as error:
        raise RecordingError(
            f"receipts cannot be saved in {directory}: {error.strerror}",
            remedy="Give a writable directory with -o",
        ) from error
    known = (number for (number,) in _NUMBER.iter_unpack(content[_NUMBER.size : whole]))
    return Receipts(store, known, keep=lambda number: _append(file, number))


def _append(file: int, number: int) -> None:
    os.write(file, _NUMBER.pack(number))
