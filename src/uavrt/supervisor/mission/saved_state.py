"""The supervisor's state on disk, in a file replaced atomically.

After a kill or a power cut the next supervisor resumes where this one was. A clean stop removes
the file, so the next start begins afresh.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path

from uavrt.commands import SystemState
from uavrt.errors import ConfigError
from uavrt.messages import FlightInfo, Tag
from uavrt.recording.kept_file import KeptFile

STATE_NAME = "supervisor_state.json"
LOCK_NAME = "supervisor.lock"


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedState:
    """Everything that a new supervisor needs to resume."""

    boot_id: str
    clock_offset_ns: int
    """Holds only within the same boot."""
    state: SystemState
    tags: tuple[Tag, ...]
    flight: FlightInfo | None
    tags_sent: int = 0
    """Tags of the last upload as its sender counted them; 0 where it did not."""
    last_flights: tuple[str, ...] = ()
    gain: int | None = None
    """As an operator has set it, in place of the settings' one."""
    waiting: dict[str, float] = field(default_factory=dict)
    """Values in force in the flight of parameters that change at the next start."""
    commander: str | None = None
    """Whose commands count."""


class StateStore(KeptFile[SavedState]):
    """The state file in the flights' directory, and the lock that allows one supervisor there.

    `directory`: where flight directories are made.
    """

    def __init__(self, directory: Path) -> None:
        super().__init__(directory / STATE_NAME, SavedState, "saved state")
        self._lock_path = directory / LOCK_NAME
        self._lock: int | None = None

    def claim(self) -> None:
        """Make sure that no other supervisor flies from this directory.

        The kernel gives the lock back when this process ends, however it ends.

        Raises `ConfigError`: another one does.
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
