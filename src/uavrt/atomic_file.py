"""Replace a file as a whole, so that a kill or a power cut leaves the old one or the new one.

The new file and then its directory are written to the disk itself (fsync) before this returns:
without that, ext4 may keep the new name and lose what is in the file.
"""

import errno
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PART = ".part"
"""Ending of a file that is still being written; one that a cut left may be removed."""
_PART_NAME = re.compile(r"\..+\.[0-9a-f]{12}\.part")
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS)


def is_part(path: Path) -> bool:
    """Whether a file's name is that of one which `replacing` was still writing."""
    return _PART_NAME.fullmatch(path.name) is not None


@contextmanager
def replacing(path: Path, *, sync: bool = True) -> Iterator[Path]:
    """Give a place to write to; what is there at the end replaces the file, with its directory.

    What a link leads to is replaced, not the link.

    `path`: the file; its directory exists.
    `sync`: False for what may be lost in a power cut and is written too often to wait.
    Raises `OSError`: the disk is full, read-only or forbidden; the old file is untouched.
    """
    path = path.resolve()
    part = path.with_name(f".{path.name}.{secrets.token_hex(6)}{PART}")
    try:
        yield part
        if sync:
            sync_to_disk(part)
        part.replace(path)
        if sync:
            sync_to_disk(path.parent)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def write_atomically(
    path: Path, content: str | bytes, *, sync: bool = True, mode: int = 0o644
) -> None:
    """Replace a file by text (UTF-8) or bytes, as `replacing` does; a device is written to.

    `mode` says who may read it: a secret is at no moment readable for others.
    """
    data = content.encode() if isinstance(content, str) else content
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    with replacing(path, sync=sync) as part:
        # Never through a link that another user has put there.
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
        with open(os.open(part, flags, 0o600), "wb") as file:
            file.write(data)
            file.flush()
            os.fchmod(file.fileno(), mode)


def make_directories(path: Path) -> None:
    """Make a directory and those above it, each on the disk before what is in it.

    Raises `OSError`: one cannot be made.
    """
    if path.is_dir():
        return
    make_directories(path.parent)
    path.mkdir(exist_ok=True)
    sync_to_disk(path.parent)


def sync_to_disk(path: Path) -> None:
    """Wait until a file or directory is on the disk; file systems that cannot say are trusted.

    Raises `OSError`: the disk is full or fails.
    """
    if path.is_dir() and not hasattr(os, "O_DIRECTORY"):
        return  # Windows
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise
    finally:
        os.close(descriptor)
