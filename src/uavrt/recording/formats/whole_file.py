"""Replace a file that a user asked for, as a whole."""

import os
from pathlib import Path

from uavrt.atomic_file import write_atomically
from uavrt.errors import RecordingError


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Make the folder, write beside the file, then rename over it.

    Raises
    ------
    RecordingError
        The disk is full, read-only or forbidden; the old file is untouched.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(target, content)
    except OSError as error:
        raise RecordingError(
            f"cannot write {target}: {error.strerror}",
            remedy="Choose a writable place with free space",
        ) from error
