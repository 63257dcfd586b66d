"""Replace a file as a whole, with an error that names what prevents it."""

import os
from pathlib import Path

from uavrt.atomic_file import make_directories, write_atomically
from uavrt.errors import RecordingError


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a temporary file in the folder, then rename it; raises `RecordingError`."""
    try:
        make_directories(Path(path).parent)
        write_atomically(Path(path), content)
    except OSError as error:
        raise RecordingError(
            f"cannot write {path}: {error.strerror}",
            remedy="Choose a writable place with free space",
        ) from error
