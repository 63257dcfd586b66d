"""Replace a file as a whole: after a kill or power cut, either the old or new file exists.

The new file and then its directory are written to the disk (fsync). Without this, ext4 may
preserve the new name but lose the content.
"""

import errno
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PART = ".part"
"""Extension of a file being written; one that a power cut left may be removed."""
_PART_NAME = re.compile(r"\..+\.[0-9a-f]{12}\.part")
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS)


def is_part(path: Path) -> bool:
    """True if a file's name is that of an unfinished copy written by `replacing`."""
    return _PART_NAME.fullmatch(path.name) is not None


@contextmanager
def replacing(path: Path, *, sync: bool = True) -> Iterator[Path]:
    """Context in which a temporary file is written; at its end, that file replaces `path`.

    If `path` is a link, its target is replaced and not the link. The directory of `path` must
    exist. `sync`: wait until file and directory are on the disk; use False for files that a
    power cut may destroy and that are written too often to wait. Raises `OSError` if the disk
    is full or read-only; the old file is then unchanged.
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
    """Replace a file's content, with permissions `mode`; text is written as UTF-8.

    A device file is not replaced but written to. Raises `OSError`.
    """
    data = content.encode() if isinstance(content, str) else content
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    with replacing(path, sync=sync) as part:
        # Never write through a link created by another user.
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
        with open(os.open(part, flags, 0o600), "wb") as file:
            file.write(data)
            file.flush()
            os.fchmod(file.fileno(), mode)


def make_directories(path: Path) -> None:
    """Create a directory and its missing parents, so that they survive a power cut.

    Raises `OSError` on failure.
    """
    if path.is_dir():
        return
    make_directories(path.parent)
    path.mkdir(exist_ok=True)
    sync_to_disk(path.parent)


def sync_to_disk(path: Path) -> None:
    """Write a file or directory to the disk now (fsync), if supported; raises `OSError`."""
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
