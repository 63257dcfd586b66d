"""Record size, time and digest of each file that a batch has written, to detect damage.

Size and modification time are compared at each run. If only the time differs, as in a copied
archive, the file is read and its digest is compared. A thorough check reads all files.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path

import msgspec

from uavrt.core.atomic_file import make_directories, write_atomically
from uavrt.core.errors import FormatError
from uavrt.core.foreign import ARCHIVE_NOTE, read_file

_DIGEST_BYTES = 16


class FileFingerprint(msgspec.Struct, frozen=True):
    """Size, modification time and digest of a file when written."""

    size: int
    time_ns: int
    digest: str
    """BLAKE2b digest of the file's content."""


def sealed(path: Path) -> FileFingerprint:
    """Return size, time and digest of a file that has just been written. Raises `OSError`."""
    about = path.stat()
    return FileFingerprint(about.st_size, about.st_mtime_ns, _digest(path.read_bytes()))


def fault_of(path: Path, seal: FileFingerprint, *, thorough: bool = False) -> str | None:
    """Reason why a file differs from its fingerprint; None if equal. Raises `OSError`."""
    try:
        about = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    if about.st_size != seal.size:
        return f"{about.st_size} bytes, and {seal.size} were written"
    if thorough or about.st_mtime_ns != seal.time_ns:
        if not path.is_file() or _digest(path.read_bytes()) != seal.digest:
            return "the digest does not match the content"
        with suppress(OSError):  # copied by another user: it is read again each time
            os.utime(path, ns=(about.st_atime_ns, seal.time_ns))
    return None


def write_note(path: Path, content: bytes) -> None:
    """Write a small file that contains its own digest, for `read_note`; raises `OSError`."""
    make_directories(path.parent)
    write_atomically(path, _digest(content).encode() + b"\n" + content)


def read_note(path: Path) -> bytes:
    """Content of a file that `write_note` wrote; raises `OSError`, `FormatError` if damaged."""
    digest, _, content = read_file(path, ARCHIVE_NOTE).partition(b"\n")
    if digest != _digest(content).encode():
        raise FormatError(f"{path} is damaged: the digest does not match the content")
    return content


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=_DIGEST_BYTES).hexdigest()
