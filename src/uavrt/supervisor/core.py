"""The supervisor: state, commands, and the processes that the state asks for.

It is a loop that asks "what should run now?" and makes it so. Records between processes pass
through it by the tables; samples do not.
"""

import asyncio
import contextlib
import logging
import os
import signal
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from uavrt.clock import Clock
from uavrt.config.settings import Settings
from uavrt.errors import UavrtError
from uavrt.ipc import Assignment, decode_record, encode_record
from uavrt.ipc.parent import adopt_orphans
from uavrt.ipc.sample_sockets import make_sample_sockets
from uavrt.ipc.topics import topic_of
from uavrt.log import get_logger
from uavrt.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Health,
    StatusText,
    SystemState,
    SystemStatus,
    Tag,
)
from uavrt.supervisor.child import Child
from uavrt.supervisor.flight import new_flight, share_tags
from uavrt.supervisor.instance import Instance, self_status
from uavrt.supervisor.output import OutputLog, warning_text
from uavrt.supervisor.systemd import SystemdNotifier
from uavrt.supervisor.table import SUPERVISOR_TOPICS, ProcessRow, consumers_of, rows_for
from uavrt.supervisor.transitions import Refused, Repeated, outcome
from uavrt.supervisor.usage import children_of

log = get_logger()

TICK_S = 0.1
STATUS_PERIOD_S = 1.0
RESTART_DELAYS_S = (0.0, 0.5, 1.0, 2.0, 5.0)
"""Wait before the first, second, … restart in a row; the last repeats."""
SETTLED_S = 30.0
"""Alive for this long: the count of restarts in a row starts anew."""
WARNING_SEVERITY = 4
"""MAV_SEVERITY_WARNING; lower numbers are worse."""
LAST_PULSES_S = 1.5
"""Time between the detectors' end and the flight's: the last pulses wait up to
`AntennaSettings.pose_wait_s` (1 s) for their pose."""


class Supervisor:
    """Holds the state, the tags and the processes.

    Parameters
    ----------
    settings : Settings
        The drone side's settings.
    on_record : callable, optional
        Also called with each record line that passes, for viewers.
    """

    def __init__(
        self, settings: Settings, *, on_record: Callable[[bytes], None] | None = None
    ) -> None:
        self.settings = settings
        self._rows = rows_for(settings)
        self.clock = Clock.start()
        self.state = SystemState.IDLE
        self.tags: dict[int, Tag] = {}
        self.flight: FlightInfo | None = None
        self._instances: dict[str, Instance] = {}
        self._sample_sockets: list[tuple[socket.socket, socket.socket]] = []
        self._replies: dict[tuple[str, int], CommandReply] = {}
        self._on_record = on_record
        self._output = OutputLog(Path(settings.recording.directory))
        self._stopping = asyncio.Event()
        self._flight_ending = False
        self._end_task: asyncio.Future[None] | None = None
        self.workers = settings.detection.workers or max(1, (os.cpu_count() or 2) - 1)

    # ------------------------------------------------------------------ life

    async def run(self) -> None:
        """Run until `stop` is called, then stop everything in reverse order."""
        adopt_orphans()
        next_status_s = 0.0
        systemd = SystemdNotifier()
        systemd.ready()
        while not self._stopping.is_set():
            self._ensure()
            if time.monotonic() >= next_status_s:
                next_status_s = time.monotonic() + STATUS_PERIOD_S
                self._publish("system_status", self.status())
                systemd.alive(self.state.value)
            try:
                await asyncio.wait_for(self._stopping.wait(), TICK_S)
            except TimeoutError:
                continue
        systemd.stopping()
        if self.state is SystemState.DETECTING:
            self.state = SystemState.HAS_TAGS
            await self._end_flight()
        for row in reversed(self._rows):
            await self._stop_row(row)

    def stop(self) -> None:
        """Ask `run` to end."""
        self._stopping.set()

    def _ensure(self) -> None:
        """Start what should run and does not; end what is silent."""
        now_s = time.monotonic()
        for row in self._rows:
            if not row.runs(self.state):
                continue
            for worker in range(self._worker_count() if row.per_worker else 1):
                name = f"{row.name}-{worker + 1}" if row.per_worker else row.name
                instance = self._instances.setdefault(name, Instance(name, row, worker))
                if instance.child is None and now_s >= instance.not_before_s:
                    self._start(instance)
                elif instance.child is not None:
                    self._watch(instance, now_s)

    def _end_orphans(self) -> None:
        """End what a killed child has left behind, above all a radio program."""
        known = {i.child.pid for i in self._instances.values() if i.child is not None}
        for pid in set(children_of(os.getpid())) - known:
            with contextlib.suppress(ProcessLookupError, ChildProcessError, PermissionError):
                log.warning("ending an orphan", pid=pid)
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)

    def _worker_count(self) -> int:
        return max(1, min(self.workers, len(self.tags)))

    def _start(self, instance: Instance) -> None:
        instance.outbox.forget("assignment")
        instance.outbox.put_first(encode_record("assignment", self._assignment(instance)))
        instance.started_s = time.monotonic()
        instance.stop_asked_s = None
        instance.health = None
        instance.child = Child(
            name=instance.name,
            module=instance.row.module,
            outbox=instance.outbox,
            pass_fds=self._fds_of(instance),
            on_line=lambda line: self._on_line(instance, line),
            on_output=lambda line: self._on_output(instance, line),
            on_exit=lambda code: self._on_exit(instance, code),
        )
        log.info("started", child=instance.name, pid=instance.child.pid)

    def _fds_of(self, instance: Instance) -> tuple[int, ...]:
        if instance.row.name == "receiver":
            return tuple(sender.fileno() for sender, _ in self._sample_sockets)
        if instance.row.per_worker:
            return (self._sample_sockets[instance.worker][1].fileno(),)
        return ()

    def _assignment(self, instance: Instance) -> Assignment:
        shares = share_tags(tuple(self.tags.values()), self._worker_count())
        return Assignment(
            process=instance.name,
            settings=self.settings,
            clock_offset_ns=self.clock.offset_ns,
            flight=self.flight,
            tags=shares[instance.worker] if instance.row.per_worker else (*self.tags.values(),),
            worker_of_tag={
                tag.tag_id: worker for worker, share in enumerate(shares) for tag in share
            },
            sample_fds=self._fds_of(instance),
        )

    def _watch(self, instance: Instance, now_s: float) -> None:
        """Kill a child that has said nothing for too long."""
        child = instance.child
        if child is None or instance.stop_asked_s is not None:
            return
        silent_s = now_s - child.last_heard_s
        if silent_s > instance.row.silence_limit_s:
            self._tell(4, f"{instance.name} silent for {silent_s:.0f} s: restarting it")
            instance.stop_asked_s = None
            child.last_heard_s = now_s
            child.kill()

    def _on_exit(self, instance: Instance, exit_code: int) -> None:
        child, instance.child = instance.child, None
        if child is not None:
            instance.cpu_s_before += child.cpu_s
        self._end_orphans()
        instance.memory_mb = 0.0
        if instance.stop_asked_s is not None:
            log.info("stopped", child=instance.name, exit_code=exit_code)
            return
        now_s = time.monotonic()
        if now_s - instance.started_s > SETTLED_S:
            instance.failures = 0
        delay_s = RESTART_DELAYS_S[min(instance.failures, len(RESTART_DELAYS_S) - 1)]
        instance.failures += 1
        instance.restarts += 1
        instance.not_before_s = now_s + delay_s
        self._tell(4, f"{instance.name} ended (exit {exit_code}): restarting it")

    async def _stop_row(self, row: ProcessRow) -> None:
        """Stop all instances of a row: SIGTERM, then SIGKILL."""
        running = [i for i in self._instances.values() if i.row is row and i.child is not None]
        for instance in running:
            instance.stop_asked_s = time.monotonic()
            if instance.child is not None:
                instance.child.terminate()
        deadline_s = time.monotonic() + row.stop_timeout_s
        while any(i.child is not None for i in running):
            if time.monotonic() > deadline_s:
                for instance in running:
                    if instance.child is not None:
                        self._tell(4, f"{instance.name} did not stop: killed")
                        instance.child.kill()
                deadline_s = time.monotonic() + row.stop_timeout_s
            await asyncio.sleep(0.02)

    # -------------------------------------------------------------- commands

    def command(self, command: Command) -> CommandReply:
        """Carry out a command, or say why not; a repeated one gets the same reply."""
        key = (command.source, command.request_id)
        if key not in self._replies:
            self._replies[key] = self._decide(command)
            while len(self._replies) > 64:
                del self._replies[next(iter(self._replies))]
        return self._replies[key]

    def _decide(self, command: Command) -> CommandReply:
        if self._flight_ending and command.name == "start_detection":
            return self._reply(command, False, "stopping: try again in a moment")
        result = outcome(self.state, command.name)
        if isinstance(result, Refused):
            return self._reply(command, False, result.reason)
        if isinstance(result, Repeated):
            return self._reply(command, True, result.message)
        try:
            message = self._carry_out(command)
        except UavrtError as error:
            return self._reply(command, False, str(error))
        self.state = result.state
        log.info("state", state=self.state.value, command=command.name, source=command.source)
        return self._reply(command, True, message)

    def _reply(self, command: Command, accepted: bool, message: str) -> CommandReply:
        if not accepted:
            log.warning("command refused", command=command.name, reason=message)
        return CommandReply(
            request_id=command.request_id,
            name=command.name,
            accepted=accepted,
            message=message,
        )

    def _carry_out(self, command: Command) -> str:
        match command.name:
            case "start_tags":
                self.tags.clear()
                return ""
            case "add_tag":
                return self._add_tag(command.tag)
            case "end_tags":
                if not self.tags:
                    raise UavrtError("no tag was sent: send TAG before END_TAGS")
                return f"{len(self.tags)} tags"
            case "start_detection":
                return self._start_flight(command)
            case "stop_detection":
                self._flight_ending = True
                self._end_task = asyncio.ensure_future(self._end_flight())
                return self.flight.directory if self.flight else ""
            case "raw_capture":
                raise UavrtError("no raw capture")

    def _add_tag(self, tag: Tag | None) -> str:
        if tag is None:
            raise UavrtError("the tag is missing")
        if self.tags.get(tag.tag_id, tag) != tag:
            raise UavrtError(f"tag {tag.tag_id} was already sent with other values")
        self.tags[tag.tag_id] = tag
        return ""

    def _start_flight(self, command: Command) -> str:
        settings = self.settings
        if command.gain is not None:
            settings = replace(settings, radio=replace(settings.radio, gain=command.gain))
        self.settings = settings
        self.flight = new_flight(
            settings,
            (*self.tags.values(),),
            self.clock,
            center_frequency_hz=command.center_frequency_hz,
        )
        self._sample_sockets = [make_sample_sockets() for _ in range(self._worker_count())]
        self._output.open_flight(Path(self.flight.directory))
        self._publish("flight", self.flight)
        self._tell(
            6, f"Detecting {len(self.tags)} tags at {self.flight.center_frequency_hz:.0f} Hz"
        )
        return self.flight.directory

    async def _end_flight(self) -> None:
        """Stop receiver, then detectors; give the last pulses time; close the flight."""
        try:
            for row in reversed(self._rows):
                if not row.runs(SystemState.HAS_TAGS):
                    await self._stop_row(row)
            await asyncio.sleep(LAST_PULSES_S)
            flight, self.flight = self.flight, None
            if flight is not None:
                self._publish("flight_end", flight)
            self._output.close_flight()
            for sockets in self._sample_sockets:
                for sock in sockets:
                    sock.close()
            self._sample_sockets = []
            self._tell(6, "Detection stopped")
        finally:
            self._flight_ending = False

    # --------------------------------------------------------------- records

    def _on_line(self, instance: Instance, line: bytes) -> None:
        name = topic_of(line)
        if name not in instance.row.produces:
            log.warning("unexpected record", child=instance.name, line=repr(line[:80]))
            return
        self._forward(name, line + b"\n")
        if name in SUPERVISOR_TOPICS:
            try:
                self._handle(instance, *decode_record(line))
            except ValueError as error:
                log.warning("bad record", child=instance.name, error=str(error))

    def _handle(self, instance: Instance, topic: str, record: object) -> None:
        match record:
            case Command():
                self._publish("command_reply", self.command(record))
            case Health():
                instance.health = record
            case StatusText():
                log.info(record.text, child=instance.name)

    def _on_output(self, instance: Instance, line: bytes) -> None:
        self._output.write(instance.name, line)
        text = warning_text(instance.name, line)
        if text is not None:
            self._tell(text.severity, text.text)

    def _publish(self, topic: str, record: object) -> None:
        self._forward(topic, encode_record(topic, record))

    def _tell(self, severity: int, text: str) -> None:
        """Send a text to the operator and into the log."""
        level = logging.WARNING if severity <= WARNING_SEVERITY else logging.INFO
        log.log(level, text)
        self._publish("status_text", StatusText(severity=severity, text=text))

    def _forward(self, topic: str, line: bytes) -> None:
        for row in consumers_of(topic, self._rows):
            instance = self._instances.setdefault(row.name, Instance(row.name, row, 0))
            instance.outbox.put(line)
            if instance.child is not None:
                instance.child.pump()
        if self._on_record is not None:
            self._on_record(line)

    # ---------------------------------------------------------------- status

    def status(self) -> SystemStatus:
        """Describe the whole drone side now."""
        return SystemStatus(
            time_ns=self.clock.now_ns(),
            # Until the last pulse is recorded the flight is not over for the operator.
            state=SystemState.DETECTING if self._flight_ending else self.state,
            flight_directory=self.flight.directory if self.flight else None,
            center_frequency_hz=self.flight.center_frequency_hz if self.flight else None,
            tags=(*self.tags.values(),),
            processes=(
                self_status(self.state, self._instances.values()),
                *(instance.status() for instance in self._instances.values()),
            ),
        )
