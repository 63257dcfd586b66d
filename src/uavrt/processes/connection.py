"""The connection process: autopilot and ground on one side, the drone's records on the other.

Gives each pulse its pose, hands it to the recorder, and sends it to the ground at once. Turns
tunnel payloads into commands and the supervisor's replies into acknowledgements.
"""

import asyncio
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from uavrt.clock import monotonic_s
from uavrt.commands import SystemState
from uavrt.config.parameters import PARAMETERS
from uavrt.config.settings import Settings
from uavrt.errors import ConfigError, LinkError, RecordingError, TunnelError
from uavrt.ipc.link import SupervisorGone
from uavrt.ipc.process import ProcessFrame
from uavrt.log import get_logger
from uavrt.mavlink.address import Address, parse_address
from uavrt.mavlink.component import Handlers
from uavrt.mavlink.connection import Connection
from uavrt.mavlink.dialect import ParamRequestList, ParamValue, RadioStatus
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.ftp_files import FileTree
from uavrt.mavlink.ftp_server import FileServer
from uavrt.mavlink.message import Message
from uavrt.mavlink.metadata import component_metadata
from uavrt.mavlink.pacing import Priority
from uavrt.mavlink.parameters import Requests
from uavrt.mavlink.signing import signing_from
from uavrt.mavlink.vehicle_messages import WATCHED_HZ
from uavrt.messages import (
    STATION_COUNTER,
    Beep,
    Command,
    CommandReply,
    Course,
    Delivered,
    FlightInfo,
    LiveBearing,
    MotionOffer,
    Operation,
    ProcessStatus,
    Pulse,
    PulsePose,
    Recorded,
    SearchReport,
    StatusText,
    SystemStatus,
    VehicleWish,
)
from uavrt.processes.crowd import Crowd
from uavrt.processes.ground_status import GroundStatus
from uavrt.processes.heard_tags import HeardTags
from uavrt.processes.motion_desk import MotionDesk, Outlets
from uavrt.processes.named_values import NamedValues
from uavrt.processes.parameter_desk import ParameterDesk
from uavrt.processes.pose_desk import PoseDesk
from uavrt.processes.pulse_outlet import PulseOutlet
from uavrt.processes.signing_memory import SigningMemory
from uavrt.recording.disk_thread import DiskThread
from uavrt.recording.heard import heard_tags
from uavrt.tunnel.delivery import PulseDelivery
from uavrt.tunnel.exchange import Answer, Exchange
from uavrt.tunnel.gate import Gate
from uavrt.tunnel.link_messages import UNSEALED
from uavrt.tunnel.live_bearing import BEARING_TYPE, encode_bearing
from uavrt.tunnel.motion import MotionState, encode_state, number_of
from uavrt.tunnel.neighbours import encode_course
from uavrt.tunnel.private import COURSE_TYPE, MOTION_STATE_TYPE, SEALED_TYPE, SESSION_TYPE
from uavrt.tunnel.seal import (
    ALIVE_INSIDE,
    CODED_TAG_INSIDE,
    MOTION_INSIDE,
    NEIGHBOUR_INSIDE,
    PARAMETER_INSIDE,
    PLAIN_INSIDE,
    RECEIPT_INSIDE,
)
from uavrt.tunnel.wire import PAYLOAD_TYPE
from uavrt.units import NANOSECONDS_PER_SECOND

log = get_logger()

TICK_S = 0.05
SESSION_NS = NANOSECONDS_PER_SECOND
LINK_RETRY_S = 3.0
MAVLINK_SOURCE = "mavlink "
PEERS = ("autopilot", "ground station")
FIRST_REFILL_NS = 4_000_000_000
"""By then the recorder has committed what the process before this one sent and delivered: what
the disk has then and no ground station, is to be sent."""


class _Taker(Protocol):
    """Handler of a ground station's message."""

    def __call__(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle its payload."""


class ConnectionProcess:
    """The state of the process; see the module's text."""

    def __init__(self, frame: ProcessFrame) -> None:
        settings = frame.assignment.settings
        mavlink = settings.mavlink
        self._frame = frame
        self._base = frame.clock
        """What everything here is timed by; a flight's clock differs by the poses' shift."""
        self._addresses = {
            number: address
            for number, address in enumerate((mavlink.address, *mavlink.direct_links))
            if address
        }
        self._disk = DiskThread()
        self._poses = PoseDesk(
            settings,
            frame.clock,
            record=lambda poses: frame.send("poses", poses),
            say=self._say,
        )
        self._delivery = PulseDelivery()
        self._exchange = Exchange(
            mavlink.tunnel_generation,
            version=mavlink.tunnel_version,
            experimental=mavlink.tunnel_experimental,
        )
        signing = signing_from(mavlink, frame.clock.now_ns)
        flights = Path(settings.recording.directory)
        self._signing_memory = None if signing is None else SigningMemory(signing, flights)
        guidance = frame.assignment.settings.guidance
        self._link = Connection(
            Handlers(
                vehicle=self._vehicle_message,
                autopilot_found=self._autopilot_found,
                attitude=self._poses.attitude,
                position=self._poses.position,
                tunnel=self._tunnel,
                private=self._private,
                ftp=self._ftp,
                radio_status=self._radio_status,
                parameters=self._parameter_request,
            ),
            frame.clock.now_ns,
            links=1 + len(mavlink.direct_links),
            component_id=mavlink.component_id,
            attitude_rate_hz=mavlink.attitude_rate_hz,
            position_rate_hz=mavlink.position_rate_hz,
            gap_s=mavlink.tunnel_gap_s,
            parameter_encoding=mavlink.parameter_encoding,
            signing=signing,
            watched_hz=WATCHED_HZ if guidance.enabled else {},
            own_system_id=mavlink.system_id if self._poses.is_own else None,
        )
        self._motion: MotionDesk | None = None
        if guidance.enabled:
            self._motion = MotionDesk(
                guidance,
                Outlets(
                    command=self._link.command_autopilot,
                    leaves=lambda: self._link.commands_leave,
                    state=self._tell_motion,
                    ask=lambda command: frame.send("command", command),
                    record=frame.send,
                    tell=self._say,
                ),
                own_place=lambda: self._link.place,
                next_request_id=self._exchange.next_request_id,
                autopilot_link=_address(mavlink.address),
            )
        flight = frame.assignment.flight
        self._parameters = ParameterDesk(
            settings,
            lambda: self._link.component.parameters_bytewise,
            send=self._send_parameter,
            ask=lambda command: frame.send("command", command),
            notify=self._say,
            running=flight is not None and flight.capture_s is None,
        )
        self._outlet = PulseOutlet(
            self._exchange.pulse,
            self._note_delivered,
            self._disk,
            first_refill_ns=frame.clock.now_ns() + FIRST_REFILL_NS,
        )
        self._link.tunnel.add_source(self._outlet.sender, Priority.PULSE)
        self._heard_tags = HeardTags(() if flight is None else flight.tags)
        self._named_values = NamedValues(
            mavlink.named_values,
            wanted=lambda: self._link.other_station_present,
            pulses_wait=lambda: self._outlet.sender.waiting > 0,
        )
        self._link.tunnel.add_source(self._named_values, Priority.VALUE)
        self._link.tunnel.changed = self._outlet.sender.link_changed
        for directory in frame.assignment.last_flights:
            self._outlet.flight(directory, resumed=True)
        self._directory = "" if flight is None else flight.directory
        if flight is not None:
            self._outlet.flight(flight.directory, resumed=True)
            self._disk(partial(_heard_before, flight.directory), self._go_on_from)
        self._link.component.metadata = metadata = component_metadata(
            floats=mavlink.parameter_encoding == "float"
        )
        tree = FileTree(settings.recording.directory, metadata.files)
        self._files = FileServer(tree, self._link.tunnel.wake, self._disk)
        for number in range(1 + len(mavlink.direct_links)):
            self._link.tunnel.add_source_on(number, self._files.on(number), Priority.FILE)
        self._gate = Gate(
            mavlink.commanders, mavlink.key_file, key_required=mavlink.key_required
        )
        self._next_session_ns = 0
        self._takers: dict[int, _Taker] = {
            PLAIN_INSIDE: self._take_command,
            RECEIPT_INSIDE: self._take_receipt,
            PARAMETER_INSIDE: self._take_sealed_parameter,
            MOTION_INSIDE: self._take_motion,
            CODED_TAG_INSIDE: partial(self._take_command, coded_tag=True),
            NEIGHBOUR_INSIDE: self._take_neighbour,
            ALIVE_INSIDE: self._take_sign_of_life,
        }
        """Handlers of what ground stations send, by its number inside a seal."""
        self._crowd = Crowd()
        self._state: SystemState | None = None
        """None until the supervisor reports it: a restarted connection must not end a flight
        on the ground."""
        self._processes: tuple[ProcessStatus, ...] = ()
        self._stations: set[tuple[int, int]] = set()
        """Ground stations that were present at the last tick."""
        self._status = GroundStatus(self._exchange, self._link.tunnel, tree.root, self._disk)
        self._status.radio_set(settings.radio)
        self._asked_on: dict[tuple[int, int], int] = {}
        self._heard = (False, False)
        self._link_faults: dict[int, str] = {}

    async def run(self) -> None:
        """Serve until the process is to end."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._frame.link.fileno(), self._take_records)
        self._disk.start()
        tasks = [
            asyncio.create_task(self._serve_link(number, address))
            for number, address in self._addresses.items()
        ]
        if tasks:
            tasks.append(asyncio.create_task(self._link.keep_time()))
        if self._poses.is_own:
            tasks.append(asyncio.create_task(self._poses.run()))
        try:
            while self._frame.running:
                self._tick()
                for task in tasks:
                    if task.done():
                        task.result()
                await asyncio.sleep(TICK_S)
            self._pass_on(self._poses.flush())
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._files.close()
            await self._disk.finish()

    async def _serve_link(self, number: int, address: str) -> None:
        """Open a link, again and again if need be: a missing adapter may be plugged in."""
        while True:
            try:
                await self._link.serve(number, address)
            except (LinkError, ConfigError) as error:
                fault = str(error)
                if fault != self._link_faults.get(number):
                    log.warning("link fault", reason=fault)
                self._link_faults[number] = fault
            await asyncio.sleep(LINK_RETRY_S)

    # ------------------------------------------------------------- from the hub

    def _take_records(self) -> None:
        try:
            for topic, record in self._frame.receive():
                self._take(topic, record)
        except SupervisorGone:
            self._frame.stop()

    def _take(self, topic: str, record: Any) -> None:
        match record:
            case Pulse():
                self._status.detector_alive(record.tag_id, self._base.now_ns())
                self._poses.add(record)
            case PulsePose():  # made up for by the recorder
                if self._delivery.let_out(record.pulse.key):
                    self._send_pulse(record)
            case Recorded():
                known = [self._delivery.recorded(key) for key in record.pulses]
                if not all(known):
                    self._outlet.disk_has_news()
            case LiveBearing() if self._addresses:
                self._link.tunnel.send_tunnel(
                    encode_bearing(record), Priority.STATUS, payload_type=BEARING_TYPE
                )
            case Beep():
                self._status.beep(record)
            case Operation():
                self._answer(self._exchange.progress(record))
            case FlightInfo() if topic == "corrected_tags":
                self._status.forget_beeps()
            case FlightInfo():
                self._poses.use_clock(record.clock_offset_ns)
                self._status.shift_ns = self._poses.shift_ns
                self._outlet.flight(record.directory)
                self._directory = record.directory
                self._heard_tags.begin_flight(record.tags)
                self._named_values.begin_flight()
                self._status.forget_beeps()
            case CommandReply():
                answer = self._exchange.reply(record)
                if answer is not None and record.accepted and not self._crowd.has_commander:
                    self._crowd.commander(answer.asker)  # until the supervisor says who it is
                self._answer(answer)
                self._parameters.reply(record)
                if self._motion is not None:
                    self._motion.reply(record)
            case MotionOffer() if self._motion is not None:
                self._motion.offer(record)
            case VehicleWish() if self._motion is not None:
                self._motion.wish(record)
            case Course() if self._addresses:
                self._tell_course(record)
            case Settings():
                self._parameters.changed(record)
                self._status.radio_set(record.radio)
                self._poses.use(record.pose)
            case StatusText():
                self._send_text(record)
            case SystemStatus():
                self._state, self._processes = record.state, record.processes
                self._know_commander(record.commander)
                detecting = record.state is SystemState.DETECTING and not record.ending
                self._parameters.running(detecting)
                self._status.tags(len(record.tags))
            case SearchReport() if self._addresses:
                self._status.search_report(record, self._base.now_ns())

    def _know_commander(self, source: str | None) -> None:
        """Learn which station commands: it has a share of its own and is never forgotten."""
        if source is None or not source.startswith(MAVLINK_SOURCE):
            return
        system_id, _, component_id = source.removeprefix(MAVLINK_SOURCE).partition("/")
        place = (int(system_id), int(component_id))
        self._link.keep_station(place)
        self._crowd.commander(place)

    def _tick(self) -> None:
        now_ns = self._base.now_ns()
        self._watch_clock()
        self._pass_on(self._poses.ready())
        self._outlet.sender.station_present(self._link.station_present, now_ns)
        self._outlet.tick(now_ns)
        if self._outlet.sender.unanswered(now_ns):
            self._link.tunnel.unanswered(now_ns)
        self._files.work()
        if self._signing_memory is not None:
            times = self._signing_memory.due(now_ns)
            if times is not None:
                self._disk(partial(self._signing_memory.write, times), lambda _done: None)
        if self._motion is not None:
            self._motion.tick(self._silent_s())
        if self._addresses:
            self._tell_session(now_ns)
            own_pose = self._poses.due(now_ns)
            if own_pose is not None:
                self._link.component.send_pose(own_pose, now_ns)
            if self._state is not None:
                self._status.tick(self._shown_state(self._state), now_ns)
            stations = self._link.stations_silent_s().keys()
            newcomer = not stations <= self._stations
            self._stations = set(stations)
            self._status.faults(self._processes, now_ns, newcomer=newcomer)
            self._say_who_is_there()
        self._link.tunnel.wake()
        if self._disk.failure is not None:
            raise self._disk.failure
        fault = 0 in self._addresses and self._link.link is None and 0 in self._link_faults
        status = self._link.status() if self._addresses else "no autopilot configured"
        if self._poses.is_own:
            status = self._poses.missing() or (status if self._addresses else "ready")
        if self._disk.stalled_s(monotonic_s()):
            status = "waiting for disk"
        self._frame.report(
            "link fault" if fault else status, ok=not fault, counters=self._counters
        )

    def _watch_clock(self) -> None:
        """Report when the autopilot no longer says what its clock shows, and when it does."""
        stale = self._link.clock_is_stale
        if stale == self._poses.clock_is_stale:
            return
        self._poses.clock_is_stale = stale
        known = self._link.component.time_sync.counters(self._base.now_ns())
        if stale:
            log.warning("autopilot's clock is carried on", **known)
            text = "Autopilot's clock: no answer for 10 s, times are carried on"
            self._say(StatusText(severity=4, text=text))
        else:
            log.info("autopilot's clock known", **known)

    def _say(self, text: StatusText) -> None:
        """Send a text of our own to the operator and into the flight.

        The supervisor passes it to the others only.
        """
        self._frame.send("status_text", text)
        self._send_text(text)

    def _send_text(self, text: StatusText) -> None:
        if self._addresses:
            self._status.text(text, self._base.now_ns())

    def _tell_session(self, now_ns: int) -> None:
        """Report once a second what commands must be sealed for."""
        if now_ns < self._next_session_ns:
            return
        self._next_session_ns = now_ns + SESSION_NS
        session = self._gate.announcement(self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.STATUS, payload_type=SESSION_TYPE)

    def _say_who_is_there(self) -> None:
        """Log it when the autopilot or the ground appears or falls silent."""
        heard = (self._link.autopilot_present, self._link.station_present)
        for name, before, now in zip(PEERS, self._heard, heard, strict=True):
            if before != now:
                event = f"{name} heard" if now else f"{name} lost"
                log.info(event, **self._link.peers())
        self._heard = heard

    def _shown_state(self, state: SystemState) -> SystemState:
        """Get the system's state; detecting as long as a pulse has not gone out."""
        busy = self._poses.pulses_waiting
        busy += self._outlet.sender.waiting + self._outlet.sender.in_flight
        if state is SystemState.HAS_TAGS and busy:
            return SystemState.DETECTING
        return state

    def _pass_on(self, pulse_poses: list[PulsePose]) -> None:
        """Give pulses with their pose to the recorder and to the ground.

        The recorder has made up for a pose that this process was too late with.
        """
        for pulse_pose in pulse_poses:
            if self._delivery.let_out(pulse_pose.pulse.key):
                self._frame.send("pulse_pose", pulse_pose)
                self._send_pulse(pulse_pose)

    # ------------------------------------------------------------ from the link

    def _vehicle_message(self, message: Message, arrived_ns: int) -> None:
        if self._motion is not None:
            age_s = (self._base.now_ns() - arrived_ns) / NANOSECONDS_PER_SECOND
            late_s = self._link.component.late_s(message, arrived_ns)
            self._motion.vehicle(message, max(0.0, age_s), late_s)

    def _autopilot_found(self) -> None:
        if self._motion is not None:
            self._motion.autopilot_found()

    def _take_motion(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle an order of motion, or refuse it with the remedy."""
        asker = peer.place
        self._asked_on[asker] = peer.link
        with self._gate.order(payload, asker, sealed=sealed) as refusal:
            if self._motion is not None:
                self._motion.receive(payload, asker, refusal, sealed=sealed)
                return
            text = "this drone takes no orders of motion: see guidance.enabled"
            number = number_of(payload)
            state = MotionState(kind="refused", standing="out", text=text, request_id=number)
            self._tell_motion(encode_state(state), asker)

    def _tell_motion(self, payload: bytes, asker: tuple[int, int] | None) -> None:
        """Report the progress of an order: to its station, or to all."""
        if asker is None:
            self._link.tunnel.send_tunnel(payload, Priority.STATUS, None, MOTION_STATE_TYPE)
            return
        payload, kind, first = self._gate.answer(payload, asker, self._link.place)
        peer = Peer(*asker, self._asked_on.get(asker, 0))
        priority = Priority.ACK if first else Priority.OTHER
        self._link.tunnel.send_tunnel(payload, priority, peer, kind)

    def _take_neighbour(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle the report of another drone; ignored unless this drone takes orders."""
        if self._motion is not None:
            refusal = self._gate.refusal(peer.place, sealed=sealed)
            self._motion.neighbour(payload, peer.place, refusal, sealed=sealed)

    def _tell_course(self, course: Course) -> None:
        """Report to all where the drone is going."""
        try:
            payload = encode_course(course)
        except TunnelError as error:
            log.warning("course not told", reason=error.message)
            return
        self._link.tunnel.send_tunnel(payload, Priority.STATUS, payload_type=COURSE_TYPE)

    def _admits(self, peer: Peer, answers: int = 0) -> bool:
        """Whether to handle a message without a seal; who needs one has no share of its own."""
        place = (0, 0) if self._gate.locked else peer.place
        return self._crowd.admits(place, self._base.now_ns(), answers=answers)

    def _tunnel(self, payload: bytes, peer: Peer) -> None:
        self._private(PAYLOAD_TYPE, payload, peer)

    def _private(self, payload_type: int, payload: bytes, peer: Peer) -> None:
        """Handle a payload by its row in the table of link messages.

        A seal is checked first: however much arrives under the ids of who has the key, what
        that station sends is handled. Allowances are for what has no valid seal.
        """
        if payload_type == SEALED_TYPE:
            opened = self._gate.open(payload, peer.place, self._link.place)
            if opened is not None:
                self._takers[opened[0]](opened[1], peer, sealed=True)
            return
        row = UNSEALED.get(payload_type)
        if row is None:
            self._exchange.counters["payloads_ignored"] += 1
        elif self._admits(peer, row.answers):
            self._takers[row.inside](payload, peer, sealed=False)

    def _take_command(
        self, payload: bytes, peer: Peer, *, sealed: bool, coded_tag: bool = False
    ) -> None:
        """Handle a command from who may command, or refuse it with the reason."""
        asker = peer.place
        self._asked_on[asker] = peer.link
        reason = self._gate.refusal(asker, sealed=sealed)
        if reason is not None:
            refused = self._exchange.refuse(payload, reason, asker)
            self._answer(refused, urgent=not self._gate.locked)
            return
        result = self._exchange.receive(payload, asker, coded_tag=coded_tag)
        if isinstance(result, Command):
            self._frame.send("command", replace(result, sealed=sealed))
        else:
            self._answer(result)

    def _take_sealed_parameter(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        refusal = self._gate.refusal(peer.place, sealed=sealed)
        number = self._exchange.next_request_id()
        self._parameters.receive_sealed(payload, peer, refusal, number)

    def _take_sign_of_life(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Note a station that knows proofs, and return its nonce."""
        assert sealed
        self._asked_on[peer.place] = peer.link
        session = self._gate.sign_of_life(payload, peer.place, self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.ACK, peer, SESSION_TYPE)

    def _take_receipt(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        if self._gate.locked and not sealed:
            self._exchange.counters["payloads_ignored"] += 1
            return
        now_ns, pulses = self._base.now_ns(), self._outlet.sender
        before = pulses.stores, pulses.proven
        proven, trip_s = self._outlet.receipt(payload, peer.place, now_ns)
        if pulses.stores - before[0] or pulses.proven - before[1]:
            self._delivery.station_came()
        if proven:
            self._link.tunnel.rate.acknowledged(trip_s, now_ns)
        self._link.tunnel.wake()

    def _silent_s(self) -> dict[tuple[int, int], float]:
        """How long each ground station was silent; one that has sealed counts only by seals."""
        return self._link.stations_silent_s() | self._gate.silent_s()

    def _parameter_request(self, message: Requests, peer: Peer) -> None:
        answers = len(PARAMETERS) if isinstance(message, ParamRequestList) else 1
        if not self._admits(peer, answers):
            return
        refusal = self._gate.refusal(peer.place, sealed=False)
        self._parameters.receive(message, peer, refusal, self._exchange.next_request_id())

    def _radio_status(self, status: RadioStatus) -> None:
        now_ns = self._base.now_ns()
        self._link.tunnel.rate_of(self._link.heard_on).radio_status(status.txbuf, now_ns)

    def _ftp(self, payload: bytes, peer: Peer) -> None:
        now_ns = self._base.now_ns()
        place = peer.place
        pulses_first = self._gate.locked and self._state is SystemState.DETECTING
        proof = not pulses_first or self._gate.asks_for_files(place)
        if not self._crowd.admits_file_request(place, now_ns, proof=proof):
            return
        trip_s = self._files.receive(payload, peer, now_ns)
        others = self._crowd.has_commander and not self._crowd.commands(place)
        if trip_s is not None and not (others and peer.link == self._link.tunnel.link):
            self._link.tunnel.rate_of(peer.link).acknowledged(trip_s, now_ns)

    def _note_delivered(self, delivered: Delivered) -> None:
        time_ns = delivered.time_ns + self._poses.shift_ns
        self._frame.send("delivered", replace(delivered, time_ns=time_ns))

    # -------------------------------------------------------------- to the link

    def _answer(self, answer: Answer | None, *, urgent: bool = True) -> None:
        """Send an answer: before pulses to the station that commands, after them to others."""
        if answer is not None:
            first = urgent and self._crowd.commands(answer.asker)
            priority = Priority.ACK if first else Priority.OTHER
            self._link.tunnel.send_tunnel(answer.payload, priority, self._asker(answer))

    def _send_parameter(self, value: ParamValue, asker: Peer | None) -> None:
        """Report a value: to all, or after the pulses to one who asks without a proof."""
        tunnel = self._link.tunnel
        if asker is None or (self._crowd.commands(asker.place) and not self._gate.locked):
            tunnel.send_message(value)
        else:
            tunnel.send_message(value, Priority.OTHER, asker.link)

    def _asker(self, answer: Answer) -> Peer:
        """Who asked, and by which link: there it is answered."""
        return Peer(*answer.asker, self._asked_on.get(answer.asker, 0))

    def _send_pulse(self, pulse_pose: PulsePose) -> None:
        if self._addresses:
            self._outlet.add(pulse_pose)
            self._tell_of_tag(pulse_pose.pulse)
            self._link.tunnel.wake()

    def _go_on_from(self, found: tuple[str, dict[int, tuple[int, int]]]) -> None:
        """Know which tags were heard in this flight before the process began."""
        directory, heard = found
        if directory == self._directory:
            self._heard_tags.heard_before({tag: end_ns for tag, (_, end_ns) in heard.items()})
            self._named_values.heard_before({tag: count for tag, (count, _) in heard.items()})

    def _tell_of_tag(self, pulse: Pulse) -> None:
        """Inform those who do not know our pulses."""
        now_ns = self._base.now_ns()
        self._named_values.heard(pulse, now_ns)
        text = self._heard_tags.text(pulse)
        if text is not None and self._status.tag_text(text, now_ns):
            self._heard_tags.sent(pulse.tag_id)

    def _counters(self) -> dict[str, float]:
        return {
            **self._poses.counters(),
            "pulses_waiting_for_recorder": self._delivery.unrecorded,
            **{name: float(count) for name, count in self._exchange.counters.items()},
            **self._outlet.counters(),
            **self._files.counters(),
            "seals_refused": self._gate.refused,
            "messages_passed_over": self._crowd.passed_over,
            "parameters_refused": self._parameters.refused,
            "texts_left_out": self._status.texts_left_out,
            "beeps_left_out": self._status.beeps_left_out,
            "disk_jobs_waiting": self._disk.waiting,
            **({} if self._motion is None else self._motion.counters()),
            **self._link.counters(),
            **{
                f"{STATION_COUNTER}{system_id}_{component_id}": silent_s
                for (system_id, component_id), silent_s in (
                    self._link.stations_silent_s().items()
                )
            },
        }


def _address(text: str | None) -> Address | None:
    """Read the address of a link; None for what is none, which is told where it is opened."""
    with suppress(ConfigError):
        return parse_address(text or "")
    return None


def _heard_before(directory: str) -> tuple[str, dict[int, tuple[int, int]]]:
    """Get what the flight's database has of each tag, nothing if it cannot be read."""
    try:
        return directory, heard_tags(directory)
    except RecordingError as error:
        log.warning("tags heard before are not known", reason=error.message)
        return directory, {}


def main() -> None:
    """Connect until told to stop."""
    with ProcessFrame.start() as frame:
        asyncio.run(ConnectionProcess(frame).run())


if __name__ == "__main__":
    main()
