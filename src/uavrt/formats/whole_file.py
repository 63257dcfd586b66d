"""Replace a text file completely or not at all."""

import os
from pathlib import Path

from uavrt.core.atomic_file import make_directories, write_atomically
from uavrt.core.errors import FormatError, RecordingError, os_errors_as


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Replace a file completely or not at all, by a temporary file; raises `RecordingError`."""
    with os_errors_as(
        RecordingError, f"cannot write {path}", "Choose a writable directory with free space"
    ):
        make_directories(Path(path).parent)
        write_atomically(Path(path), content)


def require_plain_name(name: str) -> None:
    """Raise `FormatError` for a file name that a CSV without quotes cannot contain."""
    if "," in name or "\n" in name:
        raise FormatError(
            f"the name {name!r} cannot be written in a CSV without quotes",
            remedy="Rename the file",
        )
