"""Start, monitor, restart and stop the processes of the process table."""

import asyncio
import contextlib
import math
import os
import signal
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence

from uavrt.config.ghost_places import Receiver
from uavrt.core.clock import monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.log import get_logger
from uavrt.core.messages import FlightInfo, Tag
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import encode_record
from uavrt.drone.supervisor.mission.flight_opening import share_tags
from uavrt.drone.supervisor.mission.mission_flights import Notify
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.tree.child import Child
from uavrt.drone.supervisor.tree.child_records import Intake
from uavrt.drone.supervisor.tree.instance import Instance
from uavrt.drone.supervisor.tree.table import ProcessRow

log = get_logger()

LineHandler = Callable[[Instance, bytes], None]

SEND_BUFFER_BYTES = 4 * 1024 * 1024
SILENCE_REPORT_S = 4.0
"""Silence of a process reported to the operator [s], if its limit for a kill is longer."""


class ProcessTree:
    """Starts, monitors and stops the processes of the table, in the order of the table.

    `mission` provides state, tags, flight, settings and clock. `wake` is called when a process
    has ended.
    """

    def __init__(
        self,
        rows: Sequence[ProcessRow],
        mission: Mission,
        *,
        launcher: Launcher,
        workers: int,
        notify: Notify,
        on_line: LineHandler,
        on_output: LineHandler,
        wake: Callable[[], None],
    ) -> None:
        self._rows = tuple(rows)
        self._mission = mission
        self._launcher = launcher
        self._nursery_fd: int | None = None
        self._workers = workers
        self._notify = notify
        self._on_line, self._on_output, self._wake = on_line, on_output, wake
        self._intake = Intake()
        self._instances: dict[str, Instance] = {}
        self._earlier_children = set(launcher.children())
        """Children that this program had before the tree was created; they are not orphans."""
        self._exempt: set[int] = set()
        self._ending: set[int] = set()
        self._sockets: dict[str, list[tuple[socket.socket, socket.socket]]] = {}
        self._window_hz = mission.settings.now.detection.frequency_window_hz
        """Half-width of a tag's searched band when tags were last assigned [Hz]."""
        self._receiver: Receiver | None = None
        """Radio's centre frequency and sample rate when tags were last assigned [Hz]."""
        self._restarting = asyncio.Lock()
        self._restarts_waiting = 0
        """Number of pending restarts of the search; processes start after the last one."""

    @property
    def instances(self) -> Iterable[Instance]:
        """State of each process that has run or has records to receive."""
        return self._instances.values()

    def instance_of(self, row: ProcessRow) -> Instance:
        """Return the state of a row's only process, whether it runs or not."""
        return self._instance(row.name, row, 0)

    def _instance(self, name: str, row: ProcessRow, worker: int) -> Instance:
        instance = self._instances.get(name)
        if instance is None:
            instance = self._instances[name] = Instance(name, row, worker)
        return instance

    # ------------------------------------------------------------------ running

    def ensure(self) -> None:
        """Start processes that should run; kill processes that are silent or orphaned."""
        self._check_nursery()
        self._end_orphans()
        if self._launcher.importing:
            return
        now_s = monotonic_s()
        for instance in self._wanted():
            if instance.child is None and now_s >= instance.restarts.not_before_s:
                self._start(instance)
            elif instance.child is not None:
                self._watch(instance, instance.child, now_s)

    def _check_nursery(self) -> None:
        reason = self._launcher.tend()
        if reason is not None:
            self._notify(4, f"fork server {reason}: restarting it")
        nursery_fd = self._launcher.fileno()
        if nursery_fd != self._nursery_fd:
            loop = asyncio.get_running_loop()
            if self._nursery_fd is not None:
                # It is closed, and its number may be used again.
                loop.remove_reader(self._nursery_fd)
            self._nursery_fd = nursery_fd
            if nursery_fd is not None and self._launcher.importing:
                loop.add_reader(nursery_fd, self._on_nursery, nursery_fd)

    def _on_nursery(self, nursery_fd: int) -> None:
        """Wake the supervisor: the fork server has finished its imports or has ended."""
        asyncio.get_running_loop().remove_reader(nursery_fd)
        self._wake()

    def _wanted(self) -> Iterable[Instance]:
        for row in self._rows:
            stopping = self._restarts_waiting and not row.runs(SystemState.HAS_TAGS)
            if stopping or not row.runs(self._mission.state):
                continue
            for worker in range(self._worker_count() if row.per_worker else 1):
                name = f"{row.name}-{worker + 1}" if row.per_worker else row.name
                yield self._instance(name, row, worker)

    def _worker_count(self) -> int:
        if not any(row.per_worker for row in self._rows):
            return 1
        return len(self._shares((*self._mission.upload.tags.values(),)))

    def _shares(self, tags: tuple[Tag, ...]) -> tuple[tuple[Tag, ...], ...]:
        return share_tags(
            tags, self._workers, window_hz=self._window_hz, receiver=self._receiver
        )

    def _start(self, instance: Instance) -> None:
        instance.outbox.remove_topic("assignment")
        instance.outbox.remove_topic("settings")  # older than those of the assignment
        assignment = self._assignment(instance)
        instance.outbox.put_first(encode_record("assignment", assignment))
        instance.pace.started(len(assignment.tags))
        if "search_report" in instance.row.produces:
            instance.tag_ids = tuple(tag.tag_id for tag in assignment.tags)
        instance.stop_asked_s = None
        instance.health = None
        if "command" in instance.row.produces:
            self._mission.drop_replies()
        instance.restarts.started(monotonic_s())
        try:
            instance.child = Child(
                name=instance.name,
                module=instance.row.module,
                launcher=self._launcher,
                intake=self._intake,
                outbox=instance.outbox,
                pass_fds=self._fds_of(instance),
                on_line=lambda line: self._on_line(instance, line),
                on_output=lambda line: self._on_output(instance, line),
                on_exit=lambda code: self._on_exit(instance, code),
            )
        except OSError as error:
            # No memory or no process ids left: this may pass, so go on.
            self._report_restart(instance, f"could not be started ({error.strerror})")
            return
        log.info("started", child=instance.name, pid=instance.child.pid)

    def _watch(self, instance: Instance, child: Child, now_s: float) -> None:
        if instance.stop_asked_s is not None or child.killed:
            return
        limit_s = instance.row.silence_limit_s if child.heard else instance.row.start_limit_s
        silent_s = now_s - child.last_heard_s
        late = child.heard and SILENCE_REPORT_S < silent_s < limit_s - 1.0
        if late and not instance.silence_reported:
            self._notify(4, f"{instance.name} is silent: the disk may be slow or failing")
        instance.silence_reported = late
        if silent_s > limit_s:
            instance.last_error = f"silent for {silent_s:.0f} s"
            child.kill()

    def _on_exit(self, instance: Instance, exit_code: int) -> None:
        child, instance.child = instance.child, None
        instance.outbox.process_ended(by_itself=exit_code != -signal.SIGKILL)
        if child is not None:
            instance.cpu_s_before += child.cpu_s
            instance.own_cpu_s_before += child.own_cpu_s
        self._end_orphans()
        instance.memory_mb = 0.0
        if instance.stop_asked_s is not None:
            log.info("stopped", child=instance.name, exit_code=exit_code)
            return
        reason = f"{exit_text(exit_code)}{instance.last_error and ': '}{instance.last_error}"
        self._report_restart(instance, reason)
        instance.last_error = ""
        self._wake()

    def _report_restart(self, instance: Instance, reason: str) -> None:
        restarts = instance.restarts
        delay_s = restarts.ended(monotonic_s(), reason)
        if restarts.in_a_row < restarts.policy.degraded_after:
            self._notify(4, f"{instance.name} {reason}: restarting it")
        elif restarts.in_a_row == restarts.policy.degraded_after:
            self._notify(
                3,
                f"{instance.name} degraded: ended {restarts.in_a_row} times in a row, "
                f"now tried every {delay_s:.0f} s. Last: {reason}",
            )

    @contextlib.contextmanager
    def exempt(self, pid: int) -> Iterator[None]:
        """Context in which the child `pid` is not killed although it is not in the table."""
        self._exempt.add(pid)
        try:
            yield
        finally:
            self._exempt.discard(pid)

    def _end_orphans(self) -> None:
        """Kill processes whose parent was killed, such as a radio program.

        A process that hangs in the kernel, as on a USB device, ends later; this method does not
        wait for it.
        """
        known = {i.child.pid for i in self._instances.values() if i.child is not None}
        if self._launcher.pid is not None:
            known.add(self._launcher.pid)
        orphans = set(self._launcher.children()) - known - self._earlier_children - self._exempt
        for pid in orphans:
            with contextlib.suppress(ProcessLookupError, ChildProcessError, PermissionError):
                if pid not in self._ending:
                    log.warning("killing an orphaned process", pid=pid)
                    os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, os.WNOHANG)
        self._ending = orphans

    # ----------------------------------------------------------------- stopping

    async def stop_flight(self) -> None:
        """Stop the processes that run only while detecting: receiver first, then detectors."""
        for row in reversed(self._rows):
            if not row.runs(SystemState.HAS_TAGS):
                await self._stop_row(row)
        for road in self._sockets.values():
            for sockets in road:
                for sock in sockets:
                    sock.close()
        self._sockets = {}

    async def restart_search(self) -> FlightInfo | None:
        """Restart receiver and detectors; return the flight with its tags, None if it has
        ended.
        """
        flight = self._mission.flights.flight
        self._restarts_waiting += 1
        try:
            async with self._restarting:
                await self.stop_flight()
                now = self._mission.flights.flight
                if flight is None or now is None or now.directory != flight.directory:
                    return None
                self.make_sample_sockets()
                return now
        finally:
            self._restarts_waiting -= 1
            self._wake()

    async def stop_all(self) -> None:
        """Stop all processes, in reverse order of the table."""
        for row in reversed(self._rows):
            await self._stop_row(row)

    async def _stop_row(self, row: ProcessRow) -> None:
        instances = [i for i in self._instances.values() if i.row is row]
        running = [instance for instance in instances if instance.child is not None]
        for instance in instances:
            # Ends in this flight do not count in the next.
            instance.restarts.reset_count()
        for instance in running:
            instance.stop_asked_s = monotonic_s()
            if instance.child is not None:
                instance.child.terminate()
        deadline_s = monotonic_s() + row.stop_timeout_s
        while any(i.child is not None for i in running):
            if monotonic_s() > deadline_s:
                for instance in running:
                    if instance.child is not None:
                        self._notify(4, f"{instance.name} did not stop: killed")
                        instance.child.kill()
                deadline_s = monotonic_s() + row.stop_timeout_s
            await asyncio.sleep(0.02)

    # --------------------------------------------------------------- assignment

    def make_sample_sockets(self) -> None:
        """Create a new flight's sample sockets, a pair for each receiving process."""
        self._window_hz = self._mission.settings.in_flight.detection.frequency_window_hz
        flight = self._mission.flights.flight
        if flight is not None and math.isfinite(flight.center_frequency_hz):
            self._receiver = Receiver(flight.center_frequency_hz, flight.sample_rate_hz)
        targets = {row.samples_to for row in self._rows}
        self._sockets = {
            row.name: [
                make_sample_sockets()
                for _ in range(self._worker_count() if row.per_worker else 1)
            ]
            for row in self._rows
            if row.name in targets
        }

    def _fds_of(self, instance: Instance) -> tuple[int, ...]:
        row = instance.row
        fds = []
        if row.name in self._sockets:
            fds.append(self._sockets[row.name][instance.worker][1].fileno())
        if row.samples_to is not None:
            fds += [sender.fileno() for sender, _ in self._sockets.get(row.samples_to, ())]
        return tuple(fds)

    async def wait_until_acknowledged(self, topic: str, limit_s: float) -> bool:
        """Wait until a topic's records are acknowledged; False after `limit_s` seconds."""
        deadline_s = monotonic_s() + limit_s
        receivers = [i for i in self._instances.values() if i.row.acknowledges_records]
        while any(instance.outbox.holds(topic) for instance in receivers):
            if monotonic_s() > deadline_s:
                return False
            await asyncio.sleep(0.02)
        return True

    def _assignment(self, instance: Instance) -> Assignment:
        mission = self._mission
        in_flight_only = not instance.row.runs(SystemState.HAS_TAGS)
        settings = mission.settings.in_flight if in_flight_only else mission.settings.now
        # Untaken records of an earlier flight come before the present one.
        taken = instance.outbox.flight
        flight: FlightInfo | None = (
            taken if instance.row.acknowledges_records else mission.flights.flight
        )
        tags: tuple[Tag, ...] = flight.tags if flight else (*mission.upload.tags.values(),)
        shares = self._shares(tags)
        return Assignment(
            process=instance.name,
            settings=settings,
            clock_offset_ns=mission.flights.clock.offset_ns,
            flight=flight,
            last_flights=(*mission.flights.last,),
            tags=shares[instance.worker] if instance.row.per_worker else tags,
            worker_of_tag={
                tag.tag_id: worker for worker, share in enumerate(shares) for tag in share
            },
            sample_fds=self._fds_of(instance),
        )


def exit_text(exit_code: int) -> str:
    """Return a text on how a process ended. A negative exit code is a signal's number."""
    if exit_code >= 0:
        return f"ended (exit {exit_code})"
    try:
        return f"was killed ({signal.Signals(-exit_code).name})"
    except ValueError:
        return f"was killed (signal {-exit_code})"


def make_sample_sockets() -> tuple[socket.socket, socket.socket]:
    """Make a socket pair for samples (sending, receiving) with the largest allowed buffer."""
    sender, receiver = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    sender.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    return sender, receiver
