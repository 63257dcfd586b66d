"""Replace a small file as a whole: nobody ever reads half of it."""

import contextlib
import os
from pathlib import Path

from uavrt.errors import RecordingError


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write beside the file, then rename over it.

    Raises `RecordingError`: the disk is full, read-only or forbidden; the old file is
    untouched.
    """
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.getpid()}.part")
    data = content.encode() if isinstance(content, str) else content
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        beside.write_bytes(data)
        os.replace(beside, target)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        raise RecordingError(
            f"cannot write {target}: {error.strerror}",
            remedy="Choose a writable place with free space",
        ) from error
