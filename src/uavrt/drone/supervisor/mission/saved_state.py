"""The supervisor's saved state: a file that is replaced atomically at each change.

The next supervisor resumes from it after a kill or power cut. A clean stop deletes it.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path

from uavrt.core.commands import SystemState
from uavrt.core.errors import ConfigError
from uavrt.core.messages import FlightInfo, Tag
from uavrt.flight.kept_file import KeptFile

STATE_NAME = "supervisor_state.json"
LOCK_NAME = "supervisor.lock"


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedState:
    """State that a new supervisor needs to resume a flight."""

    boot_id: str
    clock_offset_ns: int
    """Flight clock minus monotonic clock [ns]; valid until the computer restarts."""
    state: SystemState
    tags: tuple[Tag, ...]
    flight: FlightInfo | None
    tags_sent: int = 0
    """Number of tags in the last upload, as its sender announced; 0 if unknown."""
    last_flights: tuple[str, ...] = ()
    gain: int | None = None
    """Radio gain of the last start command; None if it is that of the settings."""
    waiting: dict[str, float] = field(default_factory=dict)
    """This flight's values of the parameters that will change at the next flight."""
    commander: str | None = None
    """Name of the station in command; None if there is none."""


class StateStore(KeptFile[SavedState]):
    """Reads and writes the state file, and locks the flights' directory for one supervisor."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory / STATE_NAME, SavedState, "saved state")
        self._lock_path = directory / LOCK_NAME
        self._lock: int | None = None

    def claim(self) -> None:
        """Lock the directory until this process ends; raises `ConfigError` if it is already
        locked.
        """
        import fcntl  # not where Windows runs the page, which reads the state

        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            self._complain(error)
            return
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigError(
                f"uavrt is already running with flights in {self.path.parent}",
                remedy="Stop it first, or set another recording.directory",
            ) from None
        except OSError as error:  # a file system without locks
            self._complain(error)
