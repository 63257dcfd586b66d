"""The supervisor's state on disk, in a file replaced atomically.

After a kill or a power cut the next supervisor resumes from it. A clean stop removes the file.
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
    """Clock of the flight [ns]; valid only within the same boot."""
    state: SystemState
    tags: tuple[Tag, ...]
    flight: FlightInfo | None
    tags_sent: int = 0
    """Number of tags in the last upload by its sender; 0 if not sent."""
    last_flights: tuple[str, ...] = ()
    gain: int | None = None
    """Gain set by an operator, in place of the settings' one."""
    waiting: dict[str, float] = field(default_factory=dict)
    """Present values of parameters that change at the next start."""
    commander: str | None = None
    """Station whose commands count."""


class StateStore(KeptFile[SavedState]):
    """The state file in the flights' directory, and the lock that allows one supervisor."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory / STATE_NAME, SavedState, "saved state")
        self._lock_path = directory / LOCK_NAME
        self._lock: int | None = None

    def claim(self) -> None:
        """Lock the directory for this supervisor; raises `ConfigError` if another has it.

        The kernel releases the lock when this process ends.
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
