"""Allow one writer per flight, by a lock that the kernel releases when a process ends."""

import contextlib
import fcntl
import os
import time
from pathlib import Path

POLL_S = 0.05


class WriterLock:
    """Lock on a flight's directory for the one recorder that may write there.

    A killed supervisor may still be writing its last pulses; a new recorder then waits for the
    lock.
    """

    def __init__(self) -> None:
        self._descriptor: int | None = None

    def take(self, directory: Path, wait_s: float) -> bool:
        """Take the lock, waiting if necessary; False if another process keeps the lock."""
        self.release()
        deadline_s = time.monotonic() + wait_s
        with contextlib.suppress(OSError):
            directory.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            while True:
                try:
                    fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    return True
                except BlockingIOError:
                    if time.monotonic() >= deadline_s:
                        break
                time.sleep(POLL_S)
        self.release()
        return False

    def release(self) -> None:
        """Release the lock for another process."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
