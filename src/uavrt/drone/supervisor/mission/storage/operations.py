"""Long jobs on stored flights: copying them to a drive, and removing them.

One job runs at a time, in a thread. The job reports progress as `Operation` records and texts;
the original ground station reads texts that begin with ``#`` aloud.
"""

import asyncio
import re
import threading
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from uavrt.config.settings import RecordingSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.commands import CommandName
from uavrt.core.errors import RecordingError, UavrtError
from uavrt.core.messages import Operation
from uavrt.core.units import counted
from uavrt.drone.supervisor.mission.storage.background import in_background
from uavrt.drone.supervisor.mission.storage.copying import Step, remove_flights, save_flights
from uavrt.drone.supervisor.mission.storage.flight_removal import (
    RETRY_WITHIN_S,
    SecondStep,
    removable,
)
from uavrt.flight.flight_order import flights_in_order

MOUNTS = Path("/proc/self/mounts")
REMOVABLE = ("/media/", "/run/media/")
"""Directories in which desktops and udiskie mount removable drives."""

END_S = 1.5
"""Longest wait for a running job at shutdown [s]; the whole shutdown may take 3 s."""

_ESCAPED = re.compile(r"\\([0-7]{3})")


class Operations:
    """Runs one job at a time. Its progress goes to `publish`, its texts to `notify`."""

    def __init__(
        self,
        settings: RecordingSettings,
        publish: Callable[[Operation], None],
        notify: Callable[[int, str], None],
        clock_s: Callable[[], float] = monotonic_s,
    ) -> None:
        self._settings = settings
        self._publish, self._notify = publish, notify
        self._task: asyncio.Task[None] | None = None
        self._ending = threading.Event()
        self._second_step = SecondStep(clock_s)
        self.running: Operation | None = None

    def _wanted(self) -> bool:
        return not self._ending.is_set()

    async def end(self) -> None:
        """Stop the running job at shutdown; do not wait for a drive that does not respond."""
        self._ending.set()
        if self._task is not None:
            await asyncio.wait([self._task], timeout=END_S)

    def check_free(self) -> None:
        """Raise `UavrtError` while a job runs."""
        if self.running is not None:
            raise UavrtError(f"busy: {words(self.running.name)} in progress")

    def begin(self, name: CommandName, source: str = "") -> str:
        """Begin a job, copying or removing flights; return the text of the acknowledgement."""
        self.check_free()
        root = Path(self._settings.directory)
        flights = flights_in_order(root)
        if name == "save_logs":
            target = save_directory(self._settings)
            start, end = "#Saving logs", "#Log save complete"
            work: Callable[[Step], None] = lambda step: save_flights(  # noqa: E731
                flights, target, step, self._wanted
            )
            answer = f"{counted(len(flights), 'flight')} to {target}"
        else:
            whole = len(flights)
            flights = removable(flights)
            stay = f"newest and starred flights are kept, {whole - len(flights)} of {whole}"
            if not flights:
                raise UavrtError(f"no flight can be deleted: {stay}")
            if not self._second_step.is_confirmation(source):
                raise UavrtError(
                    f"send it again after {RETRY_WITHIN_S:.0f} s to delete "
                    f"{counted(len(flights), 'flight')}: {stay}"
                )
            start, end = "#Deleting logs", "#Logs deleted"
            work = lambda step: remove_flights(flights, step, self._wanted)  # noqa: E731
            answer = f"{counted(len(flights), 'flight')}; {stay}"
        self._show(Operation(name=name, state="running", step_count=len(flights)))
        self._notify(6, start)
        self._task = asyncio.get_running_loop().create_task(self._run(work, end))
        return answer

    async def _run(self, work: Callable[[Step], None], end: str) -> None:
        loop = asyncio.get_running_loop()

        def step(done: int, whole: int, text: str) -> None:
            loop.call_soon_threadsafe(self._step, done, whole, text)

        try:
            await in_background(lambda: work(step))
        except (OSError, UavrtError) as error:
            reason = error.message if isinstance(error, UavrtError) else str(error)
            self._finish("failed", reason)
            self._notify(3, reason)
        else:
            self._finish("complete", end.lstrip("#"))
            self._notify(6, end)

    def _step(self, done: int, whole: int, text: str) -> None:
        if self.running is not None:
            changes = {"step": done, "step_count": whole, "message": text}
            self._show(replace(self.running, **changes))  # type: ignore[arg-type]

    def _finish(self, state: str, text: str) -> None:
        assert self.running is not None
        ended, self.running = self.running, None
        self._publish(replace(ended, state=state, message=text))  # type: ignore[arg-type]

    def _show(self, operation: Operation) -> None:
        self.running = operation
        self._publish(operation)


def words(name: CommandName) -> str:
    """Return the name of a job for the operator."""
    return name.replace("_", " ")


def save_directory(settings: RecordingSettings) -> Path:
    """Return the directory for copies: as configured, or on the only removable drive."""
    if settings.save_directory is not None:
        path = Path(settings.save_directory)
        if not path.is_dir():
            raise RecordingError(
                f"there is no directory {path}",
                remedy="Plug the drive in, or set recording.save_directory",
            )
        return path
    drives = removable_drives(MOUNTS.read_text(encoding="utf-8", errors="replace").splitlines())
    if len(drives) != 1:
        raise RecordingError(
            "flash drive not found" if not drives else f"{len(drives)} drives are plugged in",
            remedy="Plug one drive in, or set recording.save_directory",
        )
    return drives[0]


def removable_drives(mounts: Iterable[str]) -> list[Path]:
    """Return the mount points of plugged-in removable drives, from ``/proc/mounts``."""
    points = [line.split(" ")[1] for line in mounts if line.count(" ") >= 3]
    names = (_ESCAPED.sub(lambda octal: chr(int(octal[1], 8)), point) for point in points)
    return [Path(name) for name in names if name.startswith(REMOVABLE)]
