"""Replace a file as a whole: a reader gets the old content or the new one, never half of it."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


@contextmanager
def replacing(path: Path, *, sync: bool = True, mode: int = 0o644) -> Iterator[IO[bytes]]:
    """Open a file beside `path`, which takes its place when the block ends without an error.

    What a link leads to is replaced, not the link. With `sync` file and name are on the disk
    afterwards; without it a killed program still leaves the old or the new file, and after a
    power cut a new one may be empty. `mode` says who may read it.

    Raises
    ------
    OSError
        The directory cannot be written; the old file is untouched.
    """
    path = path.resolve()
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fchmod(file.fileno(), mode)
            if sync:
                os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    if sync:
        sync_directory(path.parent)


def write_atomically(
    path: Path, content: str | bytes, *, sync: bool = True, mode: int = 0o644
) -> None:
    """Replace a file by this content, as `replacing` does; a pipe or a device is written to."""
    data = content.encode() if isinstance(content, str) else content
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    with replacing(path, sync=sync, mode=mode) as file:
        file.write(data)


def sync_directory(directory: Path) -> None:
    """Bring the names in a directory to the disk, where the system can (Windows cannot)."""
    if hasattr(os, "O_DIRECTORY"):
        place = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(place)
        finally:
            os.close(place)
