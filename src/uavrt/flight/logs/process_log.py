"""Write the output of a process to a log file of limited size."""

from pathlib import Path

MAX_BYTES = 2_000_000
KEPT_FILES = 3
"""Number of full logs preserved for each process, 8 MB in all; ``name.log.1`` is newest."""


class ProcessLog:
    """Text log of a process that is rotated by size; lines that cannot be written are counted.

    At `max_bytes` the file is renamed, and `kept_files` older files are preserved. The
    directory of `path` is created if it is missing.
    """

    def __init__(
        self, path: Path, *, max_bytes: int = MAX_BYTES, kept_files: int = KEPT_FILES
    ) -> None:
        self._path = path
        self._max_bytes = max_bytes
        self._kept_files = kept_files
        self.lost_lines = 0
        """Number of log lines that could not be written."""

    def write(self, text: str) -> None:
        """Append a text; a newline is added if the text does not end with one."""
        content = text.encode("utf-8", "replace")
        if not content.endswith(b"\n"):
            content += b"\n"
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            if self._size() + len(content) > self._max_bytes and self._size() > 0:
                self._rotate()
            # Opened for each line: a rotated or deleted file is never written on unseen, and a
            # line every second costs nothing.
            with self._path.open("ab", buffering=0) as file:
                file.write(content)
        except OSError:
            self.lost_lines += content.count(b"\n")

    def _size(self) -> int:
        return self._path.stat().st_size if self._path.exists() else 0

    def _rotate(self) -> None:
        for number in range(self._kept_files, 0, -1):
            newer = self._numbered(number - 1) if number > 1 else self._path
            if newer.exists():
                newer.replace(self._numbered(number))

    def _numbered(self, number: int) -> Path:
        return self._path.with_name(f"{self._path.name}.{number}")
