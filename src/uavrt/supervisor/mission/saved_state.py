"""The supervisor's state on disk, in a file replaced atomically.

After a kill or a power cut the next supervisor resumes where this one was. A clean stop removes
the file, so the next start begins afresh.
"""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from uavrt.config import write_text_atomically
from uavrt.errors import ConfigError
from uavrt.log import get_logger
from uavrt.messages import FlightInfo, SystemState, Tag
from uavrt.whole_file import sync_to_disk

log = get_logger()

STATE_NAME = "supervisor_state.json"
LOCK_NAME = "supervisor.lock"
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
"""Changes at each start of the computer, when CLOCK_MONOTONIC begins anew (random(4))."""


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
    commander: str | None = None
    """Whose commands count."""


def boot_id() -> str:
    """Get a name of this start of the computer."""
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return "unknown"


class StateStore:
    """The state file in the flights' directory, and the lock that allows one supervisor there.

    A disk that cannot be written costs the memory, never the flight.

    Parameters
    ----------
    directory : Path
        Where flight directories are made.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / STATE_NAME
        self._lock_path = directory / LOCK_NAME
        self._lock: int | None = None
        self._fault = ""

    def claim(self) -> None:
        """Make sure that no other supervisor flies from this directory.

        The kernel gives the lock back when this process ends, however it ends.

        Raises
        ------
        ConfigError
            Another one does.
        """
        import fcntl  # not where Windows runs the page, which reads the state

        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            self._complain(error)
            return
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigError(
                f"uavrt is already running with flights in {self._path.parent}",
                remedy="Stop it first, or set another recording.directory",
            ) from None
        except OSError as error:  # a file system without locks
            self._complain(error)

    def load(self) -> SavedState | None:
        """Get the state of a supervisor that did not stop in good order."""
        try:
            content = self._path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            self._complain(error)
            return None
        try:
            return msgspec.json.decode(content, type=SavedState)
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            log.warning("saved state is damaged: not resumed", reason=str(error))
            with suppress(OSError):
                self._path.replace(self._path.with_suffix(".damaged"))
            return None

    def save(self, state: SavedState) -> None:
        """Replace the file; after a power cut there is the old one or the new one."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_text_atomically(self._path, msgspec.json.encode(state).decode())
            self._fault = ""
        except OSError as error:
            self._complain(error)

    def forget(self) -> None:
        """Remove the file: there is nothing to go on with."""
        try:
            self._path.unlink(missing_ok=True)
            sync_to_disk(self._path.parent)
        except OSError as error:
            self._complain(error)

    def _complain(self, error: OSError) -> None:
        fault = str(error.strerror)
        if fault != self._fault:
            log.warning("the state cannot be kept over a restart", reason=fault)
        self._fault = fault
