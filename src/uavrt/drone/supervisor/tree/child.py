"""A running child process of the supervisor: its start, records, output, stop and end."""

import asyncio
import os
import select
import signal
import socket
from collections.abc import Callable, Sequence

from uavrt.core.clock import monotonic_s
from uavrt.core.log import get_logger
from uavrt.drone.ipc.parent import PARENT_VARIABLE
from uavrt.drone.ipc.record_link import LINK_VARIABLE, LineBuffer
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.start.usage import measure
from uavrt.drone.supervisor.tree.child_records import Intake
from uavrt.drone.supervisor.tree.waiting_records import Outbox

log = get_logger()

LineHandler = Callable[[bytes], None]
READ_BYTES = 65_536
"""Most bytes read from a process in one call. For reads of 128 KiB, glibc would map new memory
each time."""


class Child:
    """A running process with a socket for records and a pipe for its output.

    `intake` schedules the reading of records; `outbox` holds the records to send, and outlives
    the process. Raises `OSError` if the process cannot be started, or cannot be watched; then
    it runs as an orphan.
    """

    def __init__(
        self,
        *,
        name: str,
        module: str,
        launcher: Launcher,
        intake: Intake,
        outbox: Outbox,
        pass_fds: Sequence[int],
        on_line: LineHandler,
        on_output: LineHandler,
        on_exit: Callable[[int], None],
    ) -> None:
        self.name = name
        self.exit_code: int | None = None
        self.heard = False
        """True once the process has sent a record, which means that its imports are done."""
        self.killed = False
        self.last_heard_s = monotonic_s()
        self.cpu_s = self.own_cpu_s = 0.0
        self.own_memory_mb = 0.0
        self._loop = asyncio.get_running_loop()
        self._launcher = launcher
        self._intake = intake
        self._outbox = outbox
        self._on_line, self._on_output, self._on_exit = on_line, on_output, on_exit
        self._lines, self._output = LineBuffer(), LineBuffer()
        self._writing = False
        self._sock, theirs = socket.socketpair()
        self._sock.setblocking(False)
        self._stdout, output = os.pipe()
        try:
            self.pid = launcher.start(
                module,
                name=name,
                output=output,
                fds=(theirs.fileno(), *pass_fds),
                environment={
                    LINK_VARIABLE: str(theirs.fileno()),
                    PARENT_VARIABLE: str(os.getpid()),
                },
            )
            self._pidfd = launcher.watch(self.pid)
        except OSError:
            self._sock.close()
            os.close(self._stdout)
            raise
        finally:
            theirs.close()
            os.close(output)
        os.set_blocking(self._stdout, False)
        self._intake.add(self._sock.fileno(), self._read_records)
        self._loop.add_reader(self._stdout, self._read_output)
        self._loop.add_reader(self._pidfd, self._reap)
        self.pump()

    def pump(self) -> None:
        """Send queued records until the socket is full."""
        if self.exit_code is not None:
            return
        try:
            done = self._outbox.write_to(self._sock)
        except OSError:
            return  # it is ending; the pidfd will say so
        if not done and not self._writing:
            self._loop.add_writer(self._sock, self.pump)
        elif done and self._writing:
            self._loop.remove_writer(self._sock)
        self._writing = not done

    def terminate(self) -> None:
        """Send SIGTERM to the process group of this process."""
        self._signal_group(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL to the process group of this process."""
        self.killed = True
        self._signal_group(signal.SIGKILL)

    def measure(self) -> float:
        """Measure CPU time and memory; return the resident memory including children [MB]."""
        if self.exit_code is not None:
            return 0.0
        own, usage = measure(self.pid)
        self.own_cpu_s = max(self.own_cpu_s, own.cpu_s)
        self.own_memory_mb = own.memory_mb
        self.cpu_s = max(self.cpu_s, usage.cpu_s)
        return usage.memory_mb

    def _signal_group(self, number: signal.Signals) -> None:
        try:
            self._launcher.signal(self.pid, number)
        except ProcessLookupError:
            log.debug("already gone", child=self.name)

    def _read_records(self) -> bool:
        try:
            data = self._sock.recv(READ_BYTES)
        except BlockingIOError:
            return True
        except ConnectionResetError:
            data = b""
        if not data:
            self._intake.remove(self._sock.fileno())
            return False
        self.heard = True
        self.last_heard_s = monotonic_s()
        for line in self._lines.feed(data):
            self._on_line(line)
        return True

    def _read_output(self) -> bool:
        try:
            data = os.read(self._stdout, READ_BYTES)
        except BlockingIOError:
            return True
        if not data:
            self._loop.remove_reader(self._stdout)
            return False
        for line in self._output.feed(data):
            self._on_output(line)
        return True

    def _reap(self) -> None:
        self._loop.remove_reader(self._pidfd)
        os.close(self._pidfd)
        exit_code, cpu_s = self._launcher.reap(self.pid)
        self.cpu_s = max(self.cpu_s, cpu_s)
        # A radio program that the child left behind must not block the radio.
        self._signal_group(signal.SIGKILL)
        self._drain()
        self.exit_code = exit_code
        self._on_exit(exit_code)

    def _drain(self) -> None:
        self._loop.remove_writer(self._sock)
        while select.select([self._sock], [], [], 0)[0] and self._read_records():
            pass
        while select.select([self._stdout], [], [], 0)[0] and self._read_output():
            pass
        self._intake.remove(self._sock.fileno())
        self._loop.remove_reader(self._stdout)
        self._sock.close()
        os.close(self._stdout)
