"""Temporary directory of a demo, removed at its end or by the next demo.

A demo that was killed (SIGKILL, power cut) leaves its directory behind. A running demo locks
its directory, so a directory without a lock is abandoned.
"""

import fcntl
import shutil
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from uavrt.core.errors import UavrtError, UsageError, os_errors_as

PREFIXES = ("uavrt-demo-", "uavrt-search-", "uavrt-together-")
LOCK = "running"
_YOUNG_S = 60.0
"""Age below which a directory without a lock may belong to a demo that is just starting [s]."""


@contextmanager
def workplace(prefix: str) -> Iterator[Path]:
    """Create a directory for a demo and remove it at the end.

    After a failure it stays until the next demo starts.
    """
    sweep(Path(tempfile.gettempdir()))
    place = Path(tempfile.mkdtemp(prefix=prefix))
    with (place / LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            yield place
        except UavrtError:
            raise
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
        shutil.rmtree(place, ignore_errors=True)


def sweep(directory: Path) -> None:
    """Remove the directories of demos that no longer run."""
    for prefix in PREFIXES:
        for place in directory.glob(f"{prefix}*"):
            # Another user's, or one that ends just now.
            with suppress(OSError):
                if _is_left(place):
                    shutil.rmtree(place, ignore_errors=True)


def _is_left(place: Path) -> bool:
    if place.is_symlink() or not place.is_dir():
        return False
    if not (place / LOCK).exists():
        return time.time() - place.stat().st_mtime > _YOUNG_S
    with (place / LOCK).open("r+") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


def require_free_port(port: int | None) -> None:
    """Raise `UsageError` if the page's port is in use."""
    if not port:
        return
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as sock:
        # As servers do: what a server that has ended left waiting is no obstacle.
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with os_errors_as(
            UsageError,
            f"the page cannot be served at port {port}",
            "Give another --port, or leave it out for any free one",
        ):
            sock.bind(("127.0.0.1", port))
