"""Read the warnings of the DDS library, which reports dropped messages only in this way.

The library can write them into a file as well as to stderr. The file's name is removed once the
library has opened it, so it disappears with the process.
"""

import os
import re
import tempfile
from contextlib import suppress

FILE_BYTES = 1_000_000
"""Length above which the file of warnings is truncated [bytes]."""
_TOO_LONG = re.compile(rb"dropping oversize .* ([^ ]+)/[^/ ]+$")


class DdsWarnings:
    """The file of warnings, and the position up to which it was read."""

    def __init__(self) -> None:
        self._descriptor, self.path = tempfile.mkstemp(prefix="uavrt-dds-")
        self._at = 0

    def opened(self) -> None:
        """Remove the file's name once the library has opened the file."""
        with suppress(OSError):  # not where open files cannot be removed
            os.unlink(self.path)

    def too_long(self) -> list[str]:
        """DDS topic names of the messages dropped as too long since the last call."""
        data = os.pread(self._descriptor, 1 << 16, self._at)
        whole = data[: data.rfind(b"\n") + 1]
        self._at += len(whole)
        if self._at > FILE_BYTES:
            os.ftruncate(self._descriptor, 0)
            self._at = 0
        found = map(_TOO_LONG.search, whole.splitlines())
        return [match[1].decode("utf-8", "replace") for match in found if match is not None]

    def close(self) -> None:
        """Close the file of warnings."""
        os.close(self._descriptor)
