"""Find messages that the DDS library has dropped, which only its warnings report.

The library writes its warnings to a file as well as to stderr. The file is unlinked once the
library has opened it, so it disappears when the process ends.
"""

import os
import re
import tempfile
from contextlib import suppress

FILE_BYTES = 1_000_000
"""Length above which the file of warnings is truncated [bytes]."""
_TOO_LONG = re.compile(rb"dropping oversize .* ([^ ]+)/[^/ ]+$")


class DdsWarnings:
    """The file to which the DDS library writes warnings, and the position read so far."""

    def __init__(self) -> None:
        self._descriptor, self.path = tempfile.mkstemp(prefix="uavrt-dds-")
        self._at = 0

    def opened(self) -> None:
        """Unlink the file of warnings once the DDS library has opened it."""
        with suppress(OSError):  # not where open files cannot be removed
            os.unlink(self.path)

    def too_long(self) -> list[str]:
        """Return the DDS topics of messages dropped as too long since the last call."""
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
