"""Replace a small file as a whole, and name what keeps it from being written."""

import os
from pathlib import Path

from uavrt import whole_file
from uavrt.errors import RecordingError


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write beside the file, then rename over it; see `uavrt.whole_file`.

    Raises
    ------
    RecordingError
        The disk is full, read-only or forbidden; the old file is untouched.
    """
    try:
        whole_file.make_directories(Path(path).parent)
        whole_file.write_whole(Path(path), content)
    except OSError as error:
        raise RecordingError(
            f"cannot write {path}: {error.strerror}",
            remedy="Choose a writable place with free space",
        ) from error
