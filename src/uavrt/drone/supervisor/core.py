"""The supervisor's core: routes records between processes, starts and stops the processes.

The tables define the routes. Radio samples do not pass through the supervisor.
"""

import asyncio
import logging
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

from uavrt.config.settings import Settings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    STATION_COUNTER,
    Command,
    CommandReply,
    FlightInfo,
    Health,
    RecordsHandled,
    StatusText,
    SystemStatus,
)
from uavrt.core.runtime.heap import HeapKeeper
from uavrt.drone.ipc.topics import TOPICS, decode_record, encode_record, topic_of
from uavrt.drone.supervisor.mission.last_pulses import LastPulses
from uavrt.drone.supervisor.mission.mission_progress import FlightProgress
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.radio_check import RadioTest
from uavrt.drone.supervisor.mission.saved_state import StateStore
from uavrt.drone.supervisor.mission.search_planning import request_tuning
from uavrt.drone.supervisor.mission.storage.background import in_background
from uavrt.drone.supervisor.mission.storage.disk_guard import DiskGuard
from uavrt.drone.supervisor.mission.storage.operations import Operations
from uavrt.drone.supervisor.mission.wall_clock import WallClockWatch
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.start.usage import own_usage
from uavrt.drone.supervisor.tree.child_output import OutputLog, warning_text
from uavrt.drone.supervisor.tree.instance import Instance, self_status
from uavrt.drone.supervisor.tree.process_shapes import rows_for
from uavrt.drone.supervisor.tree.process_tree import ProcessTree
from uavrt.drone.supervisor.tree.systemd import SystemdNotifier
from uavrt.drone.supervisor.tree.table import SUPERVISOR_TOPICS, consumers_of

log = get_logger()

TICK_S = 0.25
"""Period of the checks for silent processes and due restarts [s]."""
STATUS_PERIOD_S = TOPICS["system_status"].every_s or 1.0
DISK_PERIOD_S = 10.0
WARNING_SEVERITY = 4
"""MAVLink severity of a warning; lower numbers are more severe."""
LAST_POSES_S = 1.0
"""Longest wait at a flight's end for the poses of the last pulses, after
`AntennaSettings.pose_wait_s` [s]. It usually takes 0.1 s. Poses lost with a killed process are
added later by the recorder."""
CLOSE_S = 5.0
"""Longest wait for the recorder to close a flight [s]; usually 0.1 s."""


class Supervisor:
    """Runs the drone's processes, routes records between them, and carries out commands.

    `on_record`: called with each record as an encoded line.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        on_record: Callable[[bytes], None] | None = None,
        launcher: Launcher | None = None,
    ) -> None:
        directory = Path(settings.recording.directory)
        self._rows = rows_for(settings)
        self._consumers = {name: consumers_of(name, self._rows) for name in TOPICS}
        self._on_record = on_record
        self._wake = asyncio.Event()
        self._wall_clock = WallClockWatch()
        self._last_pulses = LastPulses()
        self._to_pump: dict[str, Instance] = {}
        self._radio_test: asyncio.Future[tuple[bool, str]] | None = None
        self._running_test: RadioTest | None = None
        self._stopping = False
        self._end_task: asyncio.Future[None] | None = None
        self._restart_task: asyncio.Future[None] | None = None
        self._output = OutputLog(directory)
        self._store = StateStore(directory)
        self._disk = DiskGuard(directory, settings.recording)
        self._disk_task: asyncio.Future[None] | None = None
        self._next_disk_s = 0.0
        self._launcher = launcher or Launcher()
        self._operations = Operations(
            settings.recording, lambda step: self._publish("operation", step), self._notify
        )
        self._progress = FlightProgress(lambda step: self._publish("operation", step))
        self.mission = Mission(
            settings,
            self._store,
            notify=self._notify,
            on_start=self._flight_started,
            on_stop=self._end_flight_soon,
            on_correction=self._tag_corrected,
            on_settings=lambda changed: self._publish("settings", changed),
            operations=self._operations,
            tuner=partial(request_tuning, launcher=self._launcher),
        )
        self._process_tree = ProcessTree(
            self._rows,
            self.mission,
            launcher=self._launcher,
            workers=settings.detection.worker_count,
            notify=self._notify,
            on_line=self._on_line,
            on_output=self._on_output,
            wake=self._wake.set,
        )

    @property
    def clock(self) -> Clock:
        """Clock of the present or last flight; before the first flight, the program's own."""
        return self.mission.flights.clock

    # ------------------------------------------------------------------ life

    def claim(self) -> None:
        """Lock the flights' directory, resume an interrupted flight; raises `ConfigError`."""
        self._store.claim()
        self.mission.resume()

    async def run(self) -> None:
        """Run until `stop` is called; then stop all processes in reverse order of start."""
        systemd = SystemdNotifier()
        systemd.ready()
        status_period_s = min(STATUS_PERIOD_S, systemd.watchdog_s or STATUS_PERIOD_S)
        next_status_s = 0.0
        heap = HeapKeeper(monotonic_s())
        while not self._stopping:
            self._wake.clear()
            self._process_tree.ensure()
            now_s = monotonic_s()
            if now_s >= next_status_s:
                next_status_s = now_s + status_period_s
                self._publish("system_status", self.status())
                self._warn_of_budgets(now_s)
                self._watch_wall_clock()
                self._end_capture_when_over()
                heap.keep(now_s)
                systemd.alive(self.mission.state.value)
            if now_s >= self._next_disk_s:
                self._next_disk_s = now_s + DISK_PERIOD_S
                self._check_disk()
            await self._sleep()
        systemd.stopping()
        await self._end()

    async def _sleep(self) -> None:
        timer = asyncio.get_running_loop().call_later(TICK_S, self._wake.set)
        await self._wake.wait()
        timer.cancel()

    def stop(self) -> None:
        """Make `run` stop all processes and return."""
        self._stopping = True
        self._wake.set()

    async def _end(self) -> None:
        await self._operations.end()
        if self._end_task is not None:
            await self._end_task
        if self.mission.state in (SystemState.DETECTING, SystemState.CAPTURING):
            self.mission.state = SystemState.HAS_TAGS
            await self._end_flight()
        self._launcher.close()
        await self._process_tree.stop_all()
        self.mission.delete_saved_state()

    def command(self, command: Command) -> CommandReply:
        """Carry out or refuse a command; return the reply, for a repeated command the same.

        A changed state is published before the reply.
        """
        before = self.mission.state
        reply = self.mission.command(command)
        if self.mission.state is not before:
            self._publish("system_status", self.status())
        self._wake.set()
        return reply

    # ---------------------------------------------------------------- flight

    def _flight_started(self, flight: FlightInfo) -> None:
        if self._running_test is not None:  # it would keep the radio from the flight
            self._running_test.stop()
        self._last_pulses.flight_started()
        self._process_tree.make_sample_sockets()
        self._output.open_flight(Path(flight.directory))
        self._disk.flying(Path(flight.directory))
        self._publish("flight", flight)
        self._progress.started(flight)
        if (text := self._wall_clock.flight_started(monotonic_s())) is not None:
            self._notify(4, text)
        self._next_disk_s = 0.0  # report card faults at the start

    def _tag_corrected(self, flight: FlightInfo) -> None:
        self._publish("corrected_tags", flight)
        self._restart_task = asyncio.ensure_future(self._search_again())

    async def _search_again(self) -> None:
        """Restart receiver and detectors; publish the tags again, to clear old results."""
        flight = await self._process_tree.restart_search()
        if flight is not None:
            self._publish("corrected_tags", flight)

    def _end_flight_soon(self) -> None:
        self._progress.stopping()
        self._end_task = asyncio.ensure_future(self._end_flight())

    async def _end_flight(self) -> None:
        await self._process_tree.stop_flight()
        limit_s = self.mission.settings.now.antenna.pose_wait_s + LAST_POSES_S
        if not await self._last_pulses.posed_within(limit_s):
            log.warning("last pulses stored without a pose", left=self._last_pulses.waiting)
        if self.mission.flights.flight is not None:
            self._publish("flight_end", self.mission.flights.flight)
            if not await self._process_tree.wait_until_acknowledged("flight_end", CLOSE_S):
                directory = self.mission.flights.flight.directory
                log.warning("recorder has not yet closed the flight", flight=directory)
        flight = self.mission.flight_ended()
        self._output.close_flight()
        self._disk.flying(None)
        self._notify(6, self._progress.ended(flight.directory if flight is not None else ""))
        self._publish("system_status", self.status())

    def _end_capture_when_over(self) -> None:
        if self.mission.state is SystemState.CAPTURING and self._progress.capture_over():
            number = self.clock.now_ns()  # never asked before
            self.command(Command(name="stop_detection", request_id=number, source="capture"))

    async def _answer_radio_status(self, command: Command) -> None:
        """Reply whether the radio works: from a test or, in flight, the receiver's health."""
        if self.mission.state in (SystemState.DETECTING, SystemState.CAPTURING):
            health = next(
                (i.health for i in self._process_tree.instances if i.row.name == "receiver"),
                None,
            )
            text = "starting" if health is None else health.reason or health.status
            found = health is not None and health.ok
        else:
            # One query answers all requests meanwhile: two programs cannot use the radio.
            if self._radio_test is None or self._radio_test.done():
                self._radio_test = asyncio.ensure_future(self._test_radio())
            found, text = await self._radio_test
        reply = CommandReply(
            request_id=command.request_id, name=command.name, accepted=found, message=text
        )
        self._publish("command_reply", reply)

    async def _test_radio(self) -> tuple[bool, str]:
        try:
            question = RadioTest(self.mission.settings.now.radio)
        except OSError as error:
            return False, f"the radio could not be checked ({error.strerror}): try again"
        self._running_test = question
        try:
            with self._process_tree.exempt(question.pid):
                return await in_background(question.answer)
        finally:
            self._running_test = None

    # -------------------------------------------------------------- watching

    def _watch_wall_clock(self) -> None:
        """Report a correction of the computer's clock; the flight's own clock is unaffected."""
        if self.mission.flights.flight is None:
            return
        if (again := self._wall_clock.repeated_warning(monotonic_s())) is not None:
            self._notify(4, again)
        text = self._wall_clock.check(self.clock.wall_correction_ns())
        if text is not None:
            self._notify(5, text)

    def _warn_of_budgets(self, now_s: float) -> None:
        for instance in self._process_tree.instances:
            for text in (instance.over_budget(now_s), instance.pace.check(now_s)):
                if text is not None:
                    self._notify(4, text)

    def _check_disk(self) -> None:
        if self._disk_task is None or self._disk_task.done():
            self._disk_task = asyncio.ensure_future(self._guard_disk())

    async def _guard_disk(self) -> None:
        for severity, text in await in_background(self._disk.check):
            self._notify(severity, text)

    # --------------------------------------------------------------- records

    def _on_line(self, instance: Instance, line: bytes) -> None:
        name = topic_of(line)
        if name not in instance.row.produces:
            log.warning("unexpected record ignored", child=instance.name, line=repr(line[:80]))
            return
        self._last_pulses.passed(name)
        instance.pace.record_arrived(name, monotonic_s())
        self._forward(name, line + b"\n", instance)
        if name in SUPERVISOR_TOPICS:
            try:
                self._handle(instance, *decode_record(line))
            except ValueError as error:
                log.warning("invalid record ignored", child=instance.name, error=str(error))

    def _handle(self, instance: Instance, topic: str, record: object) -> None:
        match record:
            case Command(name="radio_status"):
                self._radio_task = asyncio.ensure_future(self._answer_radio_status(record))
            case Command():
                self._publish("command_reply", self.command(record))
            case Health():
                instance.health = record
                for name, silent_s in record.counters.items():
                    if name.startswith(STATION_COUNTER):
                        place = name.removeprefix(STATION_COUNTER).replace("_", "/")
                        self.mission.commander.heard(f"mavlink {place}", silent_s)
                self._progress.heard(record)
                self._end_capture_when_over()
            case StatusText():
                log.info(record.text, child=instance.name)
            case RecordsHandled():
                instance.outbox.remove_acknowledged(record.records)

    def _on_output(self, instance: Instance, line: bytes) -> None:
        self._output.write(instance.name, line)
        text = warning_text(instance.name, line)
        if text is not None:
            self._notify(text.severity, text.text)
        if line.strip() and (text is not None or not line.startswith(b"{")):
            # A warning, or the last line of a traceback.
            instance.last_error = line.decode("utf-8", "replace").strip()[-120:]
            if text is not None:
                instance.last_error = text.text[-120:]

    def _publish(self, topic: str, record: object) -> None:
        self._forward(topic, encode_record(topic, record))

    def _notify(self, severity: int, text: str) -> None:
        level = logging.WARNING if severity <= WARNING_SEVERITY else logging.INFO
        log.log(level, text)
        self._publish("status_text", StatusText(severity=severity, text=text))

    def _forward(self, topic: str, line: bytes, sender: Instance | None = None) -> None:
        for row in self._consumers[topic]:
            instance = self._process_tree.instance_of(row)
            if instance is sender:
                continue
            instance.outbox.put(line)
            self._pump_soon(instance)
        if self._on_record is not None:
            self._on_record(line)

    def _pump_soon(self, instance: Instance) -> None:
        """Schedule one call that sends all records for a process; each call wakes it."""
        if not self._to_pump:
            asyncio.get_running_loop().call_soon(self._pump)
        self._to_pump[instance.name] = instance

    def _pump(self) -> None:
        instances, self._to_pump = self._to_pump, {}
        for instance in instances.values():
            if instance.child is not None:
                instance.child.pump()

    # ---------------------------------------------------------------- status

    def status(self) -> SystemStatus:
        """Return the state of mission, processes and disk as one record."""
        mission = self.mission
        flight = mission.flights.flight
        # Until the last pulse is recorded the flight is not over for the operator.
        state = mission.state
        if mission.flights.ending:
            capture = flight is not None and flight.capture_s is not None
            state = SystemState.CAPTURING if capture else SystemState.DETECTING
        instances = list(self._process_tree.instances)
        counters = {
            "output_lines_lost": float(self._output.lost_lines),
            "nursery_pid": float(self._launcher.pid or 0),
            "nursery_restarts": float(self._launcher.restarts),
        }
        if (free_mb := self._disk.free_mb) is not None:
            counters["disk_free_mb"] = free_mb
        return SystemStatus(
            time_ns=self.clock.now_ns(),
            state=state,
            flight_directory=flight.directory if flight else None,
            center_frequency_hz=flight.center_frequency_hz if flight else None,
            tags=(*mission.upload.tags.values(),),
            commander=mission.commander.name,
            processes=(
                self_status(mission.state, instances, own_usage(os.getpid()), counters),
                *(instance.status() for instance in instances),
            ),
            ending=mission.flights.ending,
            faults=self._disk.faults,
        )
