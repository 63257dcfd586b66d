"""The drone's computer in this program: the real supervisor, and its processes as tasks.

Only the operating system is left out. `Supervisor` starts, routes to, restarts and stops what
its table says; `TaskLauncher` gives it a task of the running loop in place of a program.
Recorder, connection and guide are the real ones; who uses a computer says what finds pulses in
the place of receiver and detectors.
"""

import asyncio
import itertools
import os
import signal
import socket
from collections.abc import Awaitable, Callable, Mapping

from uavrt.config.settings import Settings
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.record_link import LINK_VARIABLE, RecordSocket
from uavrt.drone.processes.connection import ConnectionProcess
from uavrt.drone.processes.guide import TICK_S, Guide
from uavrt.drone.processes.recorder import TURN_S, Recorder
from uavrt.drone.processes.search_thread import SearchThread
from uavrt.drone.supervisor.core import Supervisor
from uavrt.drone.supervisor.start.launcher import Launcher

Program = Callable[[ProcessFrame], Awaitable[None]]
"""Serves as one process of the table until its frame stops."""
FIRST_PID = 1 << 23
"""Above the largest number of a real process (PID_MAX_LIMIT is 4 194 304)."""


class TaskLauncher(Launcher):
    """Starts tasks in place of processes.

    `programs`: by the module that the table names.
    """

    def __init__(self, programs: Mapping[str, Program]) -> None:
        super().__init__()
        self._programs = programs
        self._numbers = itertools.count(FIRST_PID)
        self._tasks: dict[int, asyncio.Task[int]] = {}
        self._frames: dict[int, ProcessFrame] = {}
        self.started: dict[str, int] = {}
        """Process id of the newest task by its name."""
        self.failures: list[BaseException] = []
        """What ended tasks that ended by themselves."""

    def tend(self) -> None:
        """Do nothing: there is no nursery."""

    def children(self) -> tuple[int, ...]:
        """Own no process of the system."""
        return ()

    def start(
        self, module: str, *, name: str, environment: Mapping[str, str], **_: object
    ) -> int:
        """Begin a task; get the number that stands for its process id."""
        pid = self.started[name] = next(self._numbers)
        sock = socket.socket(fileno=os.dup(int(environment[LINK_VARIABLE])))
        serve = self._serve(pid, self._programs[module], sock)
        self._tasks[pid] = asyncio.create_task(serve, name=name)
        return pid

    async def _serve(self, pid: int, program: Program, sock: socket.socket) -> int:
        with sock:
            link = RecordSocket(sock)
            frame = self._frames[pid] = ProcessFrame(link, link.wait_for_assignment())
            await program(frame)
            link.flush()
        return 0

    def watch(self, pid: int) -> int:
        """Get a descriptor that can be read once a task has ended."""
        readable, kept = os.pipe()
        self._tasks[pid].add_done_callback(lambda _: os.close(kept))
        return readable

    def signal(self, pid: int, number: int) -> None:
        """End a task: at once by SIGKILL, else when it has done what it must."""
        task, frame = self._tasks.get(pid), self._frames.get(pid)
        if task is None or task.done():
            raise ProcessLookupError
        if number == signal.SIGKILL or frame is None:
            task.cancel()
        else:
            frame.stop()

    def reap(self, pid: int) -> tuple[int, float]:
        """Get the exit code of a task that has ended, and no CPU time."""
        task = self._tasks.pop(pid)
        self._frames.pop(pid, None)
        if task.cancelled():
            return -signal.SIGKILL, 0.0
        if (error := task.exception()) is not None:
            self.failures.append(error)
            return 1, 0.0
        return task.result(), 0.0


class PromptThinker(SearchThread):
    """Thinks at once instead of in a thread, in no virtual time."""

    def _start(self) -> None:
        pass

    def _put(self, job: Callable[[], object] | None) -> None:
        if not self._over:
            self._do(job)  # type: ignore[arg-type]


async def until_readable(frame: ProcessFrame, longest_s: float) -> None:
    """Wait for the supervisor's next record."""
    loop, there = asyncio.get_running_loop(), asyncio.Event()
    loop.add_reader(frame.link.fileno(), there.set)
    timer = loop.call_later(longest_s, there.set)
    try:
        await there.wait()
    finally:
        timer.cancel()
        loop.remove_reader(frame.link.fileno())


async def connect(frame: ProcessFrame) -> None:
    """Serve as the connection."""
    loop = asyncio.get_running_loop()
    try:
        await ConnectionProcess(frame).run()
    finally:
        loop.remove_reader(frame.link.fileno())


async def guide(frame: ProcessFrame) -> None:
    """Serve as the guide."""
    one = Guide(frame, lambda work: work(), PromptThinker)
    while frame.running:
        for topic, record in frame.receive():
            one.receive(topic, record)
        one.tick()
        frame.report(one.status, counters=one.counters)
        await until_readable(frame, TICK_S)


async def record(frame: ProcessFrame) -> None:
    """Serve as the recorder; a kill loses what is not committed, and the lock."""
    recorder = Recorder(frame)
    try:
        if frame.assignment.flight is not None:
            recorder.open(frame.assignment.flight)
        while frame.running:
            recorder.turn(frame.receive())
            recorder.report()
            await until_readable(frame, TURN_S)
        recorder.end()
    finally:
        recorder._lock.release()


class DroneComputer:
    """A supervisor with its processes; `run` serves them until cancelled.

    `settings`: the drone's.
    `detect`: serves as a detector.
    `on_record`: gets each line that passes the supervisor.
    `receive`: serves as the receiver.
    """

    def __init__(
        self,
        settings: Settings,
        detect: Program,
        on_record: Callable[[bytes], None],
        receive: Program,
    ) -> None:
        self.launcher = TaskLauncher(
            {
                "uavrt.drone.processes.recorder": record,
                "uavrt.drone.processes.connection": connect,
                "uavrt.drone.processes.guide": guide,
                "uavrt.drone.processes.receiver": receive,
                "uavrt.drone.processes.detector": detect,
            }
        )
        self._settings, self._on_record = settings, on_record
        self._task: asyncio.Task[None] | None = None
        self.supervisor = self._new_supervisor()

    def _new_supervisor(self) -> Supervisor:
        made = Supervisor(self._settings, on_record=self._on_record, launcher=self.launcher)
        made.claim()
        return made

    def start(self) -> None:
        """Begin to serve."""
        self._task = asyncio.create_task(self.supervisor.run())

    async def stop(self) -> None:
        """End in good order."""
        assert self._task is not None
        if self._task.done():
            self._task.result()
        self.supervisor.stop()
        await self._task

    def kill(self, name: str) -> None:
        """Kill one of the processes."""
        self.launcher.signal(self.launcher.started[name], signal.SIGKILL)
