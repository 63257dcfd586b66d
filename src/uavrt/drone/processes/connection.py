"""The connection process links the drone's processes to autopilot and ground stations.

Each pulse gets its pose and is sent to the recorder and the ground at once. The process
converts received payloads to commands, and the supervisor's replies to acknowledgements.
"""

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from uavrt.config.settings import Settings
from uavrt.core.clock import monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.errors import ConfigError, LinkError
from uavrt.core.log import get_logger
from uavrt.core.messages import STATION_COUNTER, Command, StatusText
from uavrt.core.runtime.disk_thread import DiskThread
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.record_link import SupervisorGone
from uavrt.drone.processes.connection_parts.connection_inbox import ConnectionInbox
from uavrt.drone.processes.connection_parts.ground_stations import GroundStations
from uavrt.drone.processes.connection_parts.ground_status import GroundStatus
from uavrt.drone.processes.connection_parts.parameter_handler import ParameterHandler
from uavrt.drone.processes.connection_parts.pose_collector import PoseCollector
from uavrt.drone.processes.connection_parts.pulse_path import PulsePath
from uavrt.drone.processes.connection_parts.signing_memory import SigningMemory
from uavrt.drone.processes.motions.motion_control import MotionOutputs
from uavrt.drone.processes.motions.motion_handler import MotionHandler
from uavrt.link.mavlink.autopilot.vehicle_messages import WATCHED_HZ
from uavrt.link.mavlink.component import Handlers
from uavrt.link.mavlink.dialect import RadioStatus
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.links.address import Address, parse_address
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.pacing import Priority
from uavrt.link.mavlink.sending.signing import Signing, signing_from
from uavrt.link.mavlink.services.ftp_files import FileTree
from uavrt.link.mavlink.services.ftp_server import FileServer
from uavrt.link.mavlink.services.metadata import component_metadata
from uavrt.link.tunnel.drone_exchange import Exchange
from uavrt.link.tunnel.gate import Gate
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE

log = get_logger()

TICK_S = 0.05
LINK_RETRY_S = 3.0
PEERS = ("autopilot", "ground station")


class LinkWatch:
    """Opens the links at `addresses` and reopens failed ones; link 0 leads to the autopilot."""

    def __init__(
        self, link: Connection, addresses: Mapping[int, str], memory: SigningMemory | None
    ) -> None:
        self._link, self._addresses, self._memory = link, addresses, memory
        self._faults: dict[int, str] = {}
        self._heard = (False, False)
        self._stations: frozenset[tuple[int, int]] = frozenset()

    def tasks(self) -> list[Coroutine[Any, Any, None]]:
        """Return the coroutines that keep the links open and receive from them."""
        served = [self._serve(number, address) for number, address in self._addresses.items()]
        return [*served, self._link.keep_time()] if served else []

    async def _serve(self, number: int, address: str) -> None:
        while True:
            try:
                await self._link.serve(number, address)
            except (LinkError, ConfigError) as error:
                fault = str(error)
                if fault != self._faults.get(number):
                    log.warning("link failed; next try in 3 s", reason=fault)
                self._faults[number] = fault
            await asyncio.sleep(LINK_RETRY_S)

    @property
    def linked(self) -> bool:
        """True if any link to an autopilot or ground station is configured."""
        return bool(self._addresses)

    @property
    def failed(self) -> bool:
        """True if the autopilot's link cannot be opened."""
        return 0 in self._addresses and self._link.link is None and 0 in self._faults

    def keep_signing_times(self, now_ns: int, disk: DiskThread) -> None:
        """Store the newest signing time on disk when due, to reject replayed messages later."""
        times = None if self._memory is None else self._memory.due(now_ns)
        if self._memory is not None and times is not None:
            disk(partial(self._memory.write, times), lambda _done: None)

    def new_station(self) -> bool:
        """True if a new ground station has appeared since the last call."""
        before, self._stations = self._stations, frozenset(self._link.stations_silent_s())
        return not self._stations <= before

    def log_presence(self) -> None:
        """Log when the autopilot or the ground stations are first received, or fall silent."""
        heard = (self._link.autopilot_present, self._link.station_present)
        for name, before, now in zip(PEERS, self._heard, heard, strict=True):
            if before != now:
                event = f"{name} heard" if now else f"{name} lost"
                log.info(event, **self._link.peers())
        self._heard = heard


class ConnectionProcess:
    """Creates the parts of the connection process and passes data between them."""

    def __init__(self, frame: ProcessFrame) -> None:
        settings, flight = frame.assignment.settings, frame.assignment.flight
        mavlink, now_ns = settings.mavlink, frame.clock.now_ns
        self._frame, self._now_ns = frame, now_ns
        """Link to the supervisor, and the process's clock; a flight's clock differs by
        `PoseCollector.shift_ns`."""
        self._disk = DiskThread()
        self._poses = PoseCollector(
            settings,
            frame.clock,
            record=lambda poses: frame.send("poses", poses),
            say=self._say,
        )
        signing = signing_from(mavlink, now_ns)
        flights = Path(settings.recording.directory)
        memory = None if signing is None else SigningMemory(signing, flights)
        self._link = self._connection(settings, signing)
        numbered = enumerate((mavlink.address, *mavlink.direct_links))
        addresses = {number: address for number, address in numbered if address}
        self._links = LinkWatch(self._link, addresses, memory)
        exchange = Exchange(
            mavlink.tunnel_generation,
            version=mavlink.tunnel_version,
            experimental=mavlink.tunnel_experimental,
        )
        metadata = component_metadata(floats=mavlink.parameter_encoding == "float")
        self._link.component.metadata = metadata
        tree = FileTree(settings.recording.directory, metadata.files)
        self._status = GroundStatus(exchange, self._link.tunnel, tree.root, self._disk)
        self._status.radio_set(settings.radio)
        gate = Gate(mavlink.commanders, mavlink.key_file, key_required=mavlink.key_required)
        stations = GroundStations(self._link, gate, now_ns)
        self._motion = self._motion_handler(settings, stations, exchange.next_request_id)
        parameters = ParameterHandler(
            settings,
            lambda: self._link.component.parameters_bytewise,
            send=stations.answer_parameter,
            ask=self._ask,
            notify=self._say,
            running=flight is not None and flight.capture_s is None,
        )
        self._pulses = PulsePath(
            *(frame, self._link, exchange, self._poses, self._status, self._disk),
            linked=self._links.linked,
        )
        self._files = FileServer(tree, self._link.tunnel.wake, self._disk)
        for number in range(1 + len(mavlink.direct_links)):
            self._link.tunnel.add_source_on(number, self._files.on(number), Priority.FILE)
        self._inbox = ConnectionInbox(
            *(self._link, stations, exchange, self._pulses, self._poses, self._status),
            *(parameters, self._motion),
            ask=self._ask,
            text=self._send_text,
            linked=self._links.linked,
        )

    def _connection(self, settings: Settings, signing: Signing | None) -> Connection:
        return Connection(
            Handlers(
                vehicle=self._vehicle_message,
                autopilot_found=self._autopilot_found,
                attitude=self._poses.attitude,
                position=self._poses.position,
                tunnel=lambda *payload: self._inbox.payload(PAYLOAD_TYPE, *payload),
                private=lambda *payload: self._inbox.payload(*payload),
                ftp=self._ftp,
                radio_status=self._radio_status,
                parameters=lambda *message: self._inbox.parameter_request(*message),
            ),
            self._now_ns,
            settings.mavlink,
            signing=signing,
            watched_hz=WATCHED_HZ if settings.guidance.enabled else {},
            own_system_id=settings.mavlink.system_id if self._poses.is_own else None,
        )

    def _motion_handler(
        self, settings: Settings, stations: GroundStations, next_request_id: Callable[[], int]
    ) -> MotionHandler | None:
        if not settings.guidance.enabled:
            return None
        return MotionHandler(
            settings.guidance,
            MotionOutputs(
                command=self._link.command_autopilot,
                leaves=lambda: self._link.commands_leave,
                state=stations.answer_motion,
                ask=self._ask,
                record=self._frame.send,
                text=self._say,
            ),
            own_place=lambda: self._link.place,
            next_request_id=next_request_id,
            autopilot_link=_address(settings.mavlink.address),
        )

    async def run(self) -> None:
        """Serve the links until the supervisor stops the process."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._frame.link.fileno(), self._take_records)
        self._disk.start()
        tasks = [asyncio.create_task(one) for one in self._links.tasks()]
        if self._poses.is_own:
            tasks.append(asyncio.create_task(self._poses.run()))
        try:
            while self._frame.running:
                self._tick()
                for task in tasks:
                    if task.done():
                        task.result()
                await asyncio.sleep(TICK_S)
            self._pulses.pass_on(self._poses.flush())
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._files.close()
            await self._disk.finish()

    def _take_records(self) -> None:
        try:
            for topic, record in self._frame.receive():
                self._inbox.record(topic, record)
        except SupervisorGone:
            self._frame.stop()

    def _tick(self) -> None:
        now_ns = self._now_ns()
        clock = self._link.component.time_sync
        self._poses.watch_clock(self._link.clock_is_stale, lambda: clock.counters(now_ns))
        self._pulses.tick(now_ns)
        self._files.work()
        self._links.keep_signing_times(now_ns, self._disk)
        if self._motion is not None:
            self._motion.tick(self._inbox.stations.silent_s())
        if self._links.linked:
            self._report_to_ground(now_ns)
        self._link.tunnel.wake()
        if self._disk.failure is not None:
            raise self._disk.failure
        self._frame.report(
            self._status_text(), ok=not self._links.failed, counters=self._counters
        )

    def _report_to_ground(self, now_ns: int) -> None:
        self._inbox.stations.announce_session(now_ns)
        own_pose = self._poses.due(now_ns)
        if own_pose is not None:
            self._link.component.send_pose(own_pose, now_ns)
        system, new_station = self._inbox.system, self._links.new_station()
        if system is not None:
            # As long as a pulse has not gone out, it is detecting.
            busy = system.state is SystemState.HAS_TAGS and self._pulses.unsent
            self._status.tick(SystemState.DETECTING if busy else system.state, now_ns)
        processes, faults = ((), ()) if system is None else (system.processes, system.faults)
        faults = (*faults, *self._poses.faults())
        self._status.faults(processes, faults, now_ns, new_station=new_station)
        self._links.log_presence()

    def _status_text(self) -> str:
        linked = self._links.linked
        status = self._link.status() if linked else "no autopilot configured"
        if self._poses.is_own:
            status = self._poses.missing() or (status if linked else "ready")
        if self._disk.stalled_s(monotonic_s()):
            status = "waiting for disk"
        return "link fault" if self._links.failed else status

    def _ask(self, command: Command) -> None:
        self._frame.send("command", command)

    def _say(self, text: StatusText) -> None:
        """Send a text to the ground, and to the supervisor, which records it but does not
        return it.
        """
        self._frame.send("status_text", text)
        self._send_text(text)

    def _send_text(self, text: StatusText) -> None:
        if self._links.linked:
            self._status.text(text, self._now_ns())

    def _vehicle_message(self, message: Message, arrived_ns: int) -> None:
        if self._motion is not None:
            age_s = (self._now_ns() - arrived_ns) / NANOSECONDS_PER_SECOND
            late_s = self._link.component.late_s(message, arrived_ns)
            self._motion.vehicle(message, max(0.0, age_s), late_s)

    def _autopilot_found(self) -> None:
        if self._motion is not None:
            self._motion.autopilot_found()

    def _radio_status(self, status: RadioStatus) -> None:
        now_ns = self._now_ns()
        self._link.tunnel.rate_of(self._link.receiving_link).radio_status(status.txbuf, now_ns)

    def _ftp(self, payload: bytes, peer: Peer) -> None:
        stations = self._inbox.stations
        system = self._inbox.system
        detecting = system is not None and system.state is SystemState.DETECTING
        if not stations.admits_file_request(peer, detecting=detecting):
            return
        trip_s = self._files.receive(payload, peer, self._now_ns())
        if trip_s is not None:
            stations.file_received(peer, trip_s)

    def _counters(self) -> dict[str, float]:
        stations = self._link.stations_silent_s()
        return {
            **self._poses.counters(),
            **self._inbox.counters(),
            **self._pulses.counters(),
            **self._files.counters(),
            "texts_left_out": self._status.texts_left_out,
            "beeps_left_out": self._status.beeps_left_out,
            "disk_jobs_waiting": self._disk.waiting,
            **({} if self._motion is None else self._motion.counters()),
            **self._link.counters(),
            **{
                f"{STATION_COUNTER}{system_id}_{component_id}": silent_s
                for (system_id, component_id), silent_s in stations.items()
            },
        }


def _address(text: str | None) -> Address | None:
    """Parse a link's address; None if it is invalid. Opening the link reports the fault."""
    with suppress(ConfigError):
        return parse_address(text or "")
    return None


def main() -> None:
    """Run the connection process until the supervisor stops it."""
    with ProcessFrame.start() as frame:
        asyncio.run(ConnectionProcess(frame).run())


if __name__ == "__main__":
    main()
