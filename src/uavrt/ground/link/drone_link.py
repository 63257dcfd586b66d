"""The ground's side of the tunnel: find the drone, upload tags, start, stop, receive.

`GroundProtocol` knows what to say and is pure; `GroundLink` puts it on a MAVLink link.
"""

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator, Callable, Sequence
from math import ceil
from typing import Any

from uavrt.commands import NO_UPLOAD, CommandName, Generation
from uavrt.errors import CommandRefused, LinkError, RecordingError, UavrtError
from uavrt.ground.link.command_payloads import Writing
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.drone_parameters import DroneParameters
from uavrt.ground.link.parallel_links import Links, Ways
from uavrt.ground.link.protocol import (
    Acknowledged,
    DetectorAlive,
    DroneHeartbeat,
    GroundEvent,
    GroundProtocol,
)
from uavrt.ground.link.stored_pulses import new_store
from uavrt.ground.link.vehicle_identity import DRONE_COMPONENT, VehicleIdentity
from uavrt.ground.link.vehicle_missions import VehicleMissions
from uavrt.log import get_logger
from uavrt.mavlink.dialect import FileTransferProtocol, Tunnel
from uavrt.mavlink.discovery import GCS_SYSTEM_ID, STATION_SYSTEM_ID, Peer
from uavrt.mavlink.frame import Frame
from uavrt.mavlink.link import Link
from uavrt.mavlink.message import Message
from uavrt.mavlink.signing import Signing, SigningKey
from uavrt.messages import Neighbour, Tag
from uavrt.tunnel.codec import acked_command_of
from uavrt.tunnel.coded_tag import CODED_TAG_TYPE
from uavrt.tunnel.gate import Sealer
from uavrt.tunnel.motion import MotionState, is_confirmation, is_stop
from uavrt.tunnel.neighbours import encode_neighbour
from uavrt.tunnel.private import MAX_SEALED_HASHES, MOTION_TYPE, NEIGHBOUR_TYPE
from uavrt.tunnel.seal import Key
from uavrt.tunnel.wire import PAYLOAD_TYPE
from uavrt.units import ns_from_s, s_from_ns

__all__ = [
    "Acknowledged",
    "DetectorAlive",
    "DroneHeartbeat",
    "GroundEvent",
    "GroundLink",
    "GroundProtocol",
]

log = get_logger()

HEARTBEAT_S = 1.0
RECEIPT_POLL_S = 0.05
ACK_WAIT_S = 2.0
TRIES = 4
STOP_WAIT_S = 0.4
"""Time after which a stop is sent again [s]; on a radio an answer takes 0.3 s or more."""
CONFIRMS_WITHIN_NS = ns_from_s(1.0)
"""From the operator's word until a confirmation leaves; later it is not what was meant."""
EVENTS = 20_000
"""Events kept for a slow reader; at 50 pulses a second, almost 7 minutes."""


class GroundLink:
    """A ground station's link to the drone.

    ::

        link = GroundLink(clock.now_ns)
        task = asyncio.create_task(link.run("udpin://127.0.0.1:14550"))
        await link.wait_for_drone(30.0)
        await link.upload_tags(tags)
        await link.start_detection()
        async for event in link.events():
            ...

    `on_event`: called at once with each event; without it they wait for `events`.
    `generation`: wire format; G1 unless the drone runs the thesis's software, or the original's
    numbered versions.
    `system_id`, `component_id`: our own numbers; 254/190, or 255/190 with `as_gcs`.
    `as_gcs`: be seen as a ground station of type GCS, as the original's drone side insists on.
    `ack_wait_s`: how long to wait for each acknowledgement before the command is sent again.
    `on_frame`: called with every frame of the link, the autopilot's and the radio's too.
    `receipts`: what the station holds already, from
    `uavrt.ground.link.stored_pulses.open_receipts`; without it the drone sends all of its
    flight.
    `progress`: how many pulses `on_event` has taken, and the durable ones of these: they are
    acknowledged, and nothing for which `on_event` raises `RecordingError`. Without it a pulse
    is acknowledged when `on_event` returns.
    `key`: what commands and receipts are sealed with, see `uavrt.tunnel.seal`.
    `signing_key`: what frames are signed with, see `uavrt.mavlink.signing`; then unsigned
    frames are taken from the autopilot only.
    `identity`: which vehicle is served; without it the first that is heard, for as long as this
    lives.
    `links`: links that are shared with others, who serve other vehicles on them.
    """

    def __init__(
        self,
        clock_ns: Callable[[], int],
        *,
        on_event: Callable[[GroundEvent], None] | None = None,
        generation: Generation = "G1",
        system_id: int | None = None,
        component_id: int = 190,
        as_gcs: bool = False,
        ack_wait_s: float = ACK_WAIT_S,
        on_frame: Callable[[Frame], None] | None = None,
        receipts: Receipts | None = None,
        key: Key | None = None,
        signing_key: SigningKey | None = None,
        identity: VehicleIdentity | None = None,
        links: Links | None = None,
        progress: Callable[[], tuple[int, int]] = lambda: (0, 0),
    ) -> None:
        if system_id is None:
            system_id = GCS_SYSTEM_ID if as_gcs else STATION_SYSTEM_ID
        if receipts is None and generation != "G0":
            receipts = Receipts(new_store())
        sealer = None if key is None else Sealer(key, (system_id, component_id))
        if receipts is not None and key is not None:
            receipts.most = MAX_SEALED_HASHES
        self.protocol = GroundProtocol(
            system_id,
            component_id,
            receipts,
            sealer,
            generation,
            as_gcs=as_gcs,
            identity=identity,
        )
        self._clock_ns = clock_ns
        self._on_event = on_event
        self._on_frame = on_frame
        self._progress = progress
        self.writing = Writing(generation)
        self._ack_wait_s = ack_wait_s
        self._signing = None if signing_key is None else Signing(signing_key, clock_ns)
        self._ways = Ways(
            (system_id, component_id),
            self._receive,
            clock_ns,
            signing=self._signing,
            links=links,
        )
        self._serving = False
        self._drone_signs = self._drone_refused = False
        self._events: deque[GroundEvent] = deque(maxlen=EVENTS)
        self._event_there = asyncio.Event()
        self._drone_there = asyncio.Event()
        self.parameters = DroneParameters(self.protocol, self.send, ack_wait_s)
        """The drone's parameters."""
        self.missions = VehicleMissions(self.protocol.own, self.send, self._vehicle_id)
        """The autopilot's mission and fence."""
        self._awaited: dict[tuple[int, int] | int, asyncio.Future[Any]] = {}
        """Answers, by number and request id of a command, or by the request id of a motion."""
        self._busy = asyncio.Lock()

    @property
    def link(self) -> Link | None:
        """The first MAVLink link that is open."""
        links = self._ways.links
        return links[0] if self._serving and links else None

    async def run(self, *addresses: str) -> None:
        """Serve the links until cancelled.

        `addresses`: ways to the same drone, the one to prefer first; of several, those that
        cannot be opened are tried again. None: those that another opens, and keeps alive by its
        heartbeats.
        Raises `ConfigError`: an address is none.
        Raises `LinkError`: None could be opened.
        """
        try:
            opening = await self._ways.open(addresses)
        except UavrtError:
            await self._ways.close(opened=bool(addresses))
            raise
        self._serving = True
        try:
            next_heartbeat_ns = turn = 0
            while True:
                now_ns = self._clock_ns()
                if addresses and now_ns >= next_heartbeat_ns:
                    next_heartbeat_ns = now_ns + ns_from_s(HEARTBEAT_S)
                    self._ways.send_by_all(self.protocol.heartbeat())
                self._acknowledge()
                receipt = self.protocol.receipt(now_ns)
                if receipt is not None:
                    self._ways.answer(receipt)
                links = self._ways.alive() or self._ways.best()
                for message in self.protocol.signs_of_life(len(links), now_ns):
                    self._ways.send(message, links[turn % len(links)])
                    turn += 1
                await asyncio.sleep(RECEIPT_POLL_S)
        finally:
            for task in opening:
                task.cancel()
            await self._ways.close(opened=bool(addresses))

    async def wait_for_drone(self, timeout_s: float) -> Peer:
        """Wait until component 191 is heard; raises `LinkError` when it is not."""
        try:
            async with asyncio.timeout(timeout_s):
                await self._drone_there.wait()
        except TimeoutError:
            raise self._unheard() from None
        assert self.protocol.drone is not None
        return self.protocol.drone

    def _vehicle_id(self) -> int | None:
        """System of the vehicle that is served, once it is known."""
        drone = self.protocol.drone
        return self.protocol.identity.system_id if drone is None else drone.system_id

    def _unheard(self) -> LinkError:
        """Explain why there is no drone: it is locked with another key, or not there."""
        if self._drone_refused:
            return LinkError(
                f"component {DRONE_COMPONENT} is heard, but its frames are not signed with the "
                "key given",
                remedy="Give the key that the drone has as mavlink.signing_key_file, or none "
                "if it has none",
            )
        return LinkError(
            f"no drone is heard (MAVLink component {DRONE_COMPONENT})",
            remedy="Check the drone's power, the radio, and that the autopilot forwards "
            "MAVLink between its companion and ground ports",
        )

    def _unanswered(self, number: int) -> LinkError:
        """Explain why a command has no answer: the drone wants it signed, or is away."""
        text = f"the drone did not answer command {number} in {TRIES * self._ack_wait_s:g} s"
        if self._drone_signs and self._signing is None:
            return LinkError(
                f"{text}: it signs its frames and may accept only signed ones",
                remedy="Give the drone's key with --signing-key",
            )
        return LinkError(
            text, remedy="Check the radio link and try again; repeated commands do no harm"
        )

    async def upload_tags(
        self, tags: Sequence[Tag], progress: Callable[[int, int], None] | None = None
    ) -> None:
        """Send the tag list, each message acknowledged.

        `tags`: all the tags; they replace those on the drone.
        `progress`: called with the messages acknowledged so far and their whole number.
        Raises `CommandRefused`: the drone refused; the text is its reason.
        Raises `LinkError`: it did not answer.
        """
        payloads = self.writing.upload(tags)
        coded = [False, *(tag.coded for tag in tags), False]
        for count, (payload, is_coded) in enumerate(zip(payloads, coded, strict=True), start=1):
            try:
                await self.command(payload, CODED_TAG_TYPE if is_coded else PAYLOAD_TYPE)
            except LinkError as error:
                raise _without_codes(error) if is_coded else error from error
            except CommandRefused as error:
                if count == 1 or NO_UPLOAD not in str(error):
                    raise
                raise CommandRefused(
                    "the upload was opened and then refused: two vehicles answer under number "
                    f"{self._vehicle_id()}, or another station ended it",
                    remedy="Give each vehicle a number of its own (SYSID_THISMAV, MAV_SYS_ID)",
                ) from error
            if progress is not None:
                progress(count, len(payloads))
        self.protocol.set_tags(tags)

    async def correct_tag(self, tag: Tag) -> str:
        """Replace a tag that is being searched; return the drone's message.

        Raises `CommandRefused`: the drone refused; the text is its reason.
        Raises `LinkError`: it did not answer.
        """
        answer = await self.command(self.writing.correction(tag))
        self.protocol.tags[tag.tag_id] = tag
        return answer.message

    async def start_detection(
        self, *, center_frequency_hz: float | None = None, gain: int = 0
    ) -> str:
        """Start; return the drone's message (the flight directory).

        A frequency of None is 0 on the wire: the drone's tuner chooses.
        """
        payload = self.writing.start(center_frequency_hz, gain)
        return (await self.command(payload)).message

    async def stop_detection(self) -> None:
        """Stop."""
        await self.ask("stop_detection")

    async def ask(self, name: CommandName) -> str:
        """Ask for what is only its number, as ``"save_logs"``; return the drone's message.

        Raises `CommandRefused`: the drone refused; the text is its reason.
        Raises `LinkError`: it did not answer, or its software does not know the command.
        """
        return (await self.command(self.writing.bare(name))).message

    async def command(self, payload: bytes, payload_type: int = PAYLOAD_TYPE) -> Acknowledged:
        """Send a command until it is acknowledged, with the same bytes each time.

        Raises `CommandRefused`: the drone refused it.
        Raises `LinkError`: no answer after four tries.
        """
        number = acked_command_of(payload)
        assert number is not None
        request_id = self.writing.request_id_of(payload)

        def send(attempt: int) -> None:
            order = self._ways.best()
            message = self.protocol.tunnel_message(payload, payload_type)
            self._ways.send(message, order[attempt % len(order)])

        async with self._busy:
            answer = await self._until_answered(
                (number, request_id), send, TRIES, self._ack_wait_s
            )
            if answer is None:
                raise self._unanswered(number)
            ack: Acknowledged
            attempt, ack = answer
            if attempt > 0 and request_id == 0:
                # Answers to the earlier copies may follow; they must not be taken for the
                # answer to the next command of this number: G0 and G1 have no request ids.
                await asyncio.sleep(self._ack_wait_s / 2)
        if not ack.accepted:
            raise CommandRefused(ack.message or f"the drone refused command {number}")
        return ack

    async def _until_answered(
        self, key: tuple[int, int] | int, send: Callable[[int], None], tries: int, wait_s: float
    ) -> tuple[int, Any] | None:
        """Send until an answer comes; get it with the number of the try, None without one."""
        for attempt in range(tries):
            answer = self._awaited[key] = asyncio.get_running_loop().create_future()
            try:
                try:
                    send(attempt)
                except LinkError:  # the drone's session comes within a second
                    if self.protocol.drone is None or attempt == tries - 1:
                        raise
                async with asyncio.timeout(wait_s):
                    return attempt, await answer
            except TimeoutError:
                self.protocol.counters["retries"] += 1
            finally:
                self._awaited.pop(key, None)
        return None

    async def motion(self, payload: bytes, request_id: int) -> MotionState:
        """Send an order of motion, a confirmation or a stop; return the drone's answer.

        An order and a stop are repeated until they are answered, a stop every 0.4 s; a
        confirmation is not: its nonce holds once, and what is on the way longer than a second
        is not confirmed. A stop waits for nothing else that is under way.

        `payload`: by `uavrt.tunnel.motion`.
        Raises `CommandRefused`: the drone refused; the text is its reason.
        Raises `LinkError`: it did not answer.
        """

        def send(_attempt: int) -> None:
            self.send(self.protocol.tunnel_message(payload, MOTION_TYPE))

        wait_s = min(self._ack_wait_s, STOP_WAIT_S) if is_stop(payload) else self._ack_wait_s
        tries = 1 if is_confirmation(payload) else ceil(TRIES * self._ack_wait_s / wait_s)
        self.protocol.orders.append(request_id)
        begun_ns = self._clock_ns()
        async with contextlib.nullcontext() if is_stop(payload) else self._busy:
            waited_ns = self._clock_ns() - begun_ns
            if is_confirmation(payload) and waited_ns > CONFIRMS_WITHIN_NS:
                raise LinkError(
                    f"the confirmation waited {s_from_ns(waited_ns):.0f} s for another command "
                    "and was not sent",
                    remedy="Ask for the motion again",
                )
            answer = await self._until_answered(request_id, send, tries, wait_s)
        if answer is None:
            raise LinkError(
                "the drone did not answer; nothing is known to have been confirmed",
                remedy="See `uavrt fly status`; a drone with a key needs --command-key",
            )
        state: MotionState = answer[1]
        if state.kind == "refused":
            raise CommandRefused(state.text)
        return state

    async def events(self) -> AsyncIterator[GroundEvent]:
        """Return events as they come."""
        while True:
            while self._events:
                yield self._events.popleft()
            self._event_there.clear()
            await self._event_there.wait()

    def tell_neighbour(self, told: Neighbour) -> None:
        """Tell the drone of another one, once it is there and has told its session."""
        with contextlib.suppress(LinkError):
            self.send(self.protocol.tunnel_message(encode_neighbour(told), NEIGHBOUR_TYPE))

    @property
    def refused(self) -> dict[str, int]:
        """Frames refused for their signatures, by reason."""
        return {} if self._signing is None else dict(self._signing.counters)

    @property
    def faults(self) -> int:
        """Frames that could not be handled, on all links."""
        return sum(link.counters.faults for link in self._ways.links)

    def send(self, message: Message) -> None:
        """Send a message that needs no acknowledgement."""
        if isinstance(message, FileTransferProtocol):
            self.protocol.files_asked_ns = self._clock_ns()
        self._ways.send(message)

    def _receive(self, frame: Frame, link: int) -> None:
        if frame.component_id == DRONE_COMPONENT:
            self._drone_signs = frame.signed
        if self._signing is not None and not self._signing.accepts(frame):
            self._drone_refused |= frame.component_id == DRONE_COMPONENT
            return
        if self._on_frame is not None:
            self._on_frame(frame)
        self.parameters.take(frame)
        self.missions.take(frame)
        try:
            for event in self.protocol.receive(frame, self._clock_ns()):
                self._deliver(event)
            self.protocol.taken(self._progress()[0])
            self._acknowledge()
        except RecordingError as error:  # it comes again, as it is not acknowledged
            self.protocol.counters["not_stored"] += 1
            log.seldom(self.protocol.counters["not_stored"], "not stored", reason=str(error))
        if self.protocol.drone is not None:
            self._drone_there.set()
            if (frame.system_id, frame.component_id) == (
                self.protocol.drone.system_id,
                DRONE_COMPONENT,
            ):
                self._ways.heard_drone(link, pulse=frame.message_id == Tunnel.ID)

    def _acknowledge(self) -> None:
        """Let the next receipt name what is on the disk."""
        self.protocol.stored(self._progress()[1])

    def _deliver(self, event: GroundEvent) -> None:
        key: tuple[int, int] | int | None = None
        if isinstance(event, Acknowledged):
            key = event.command, event.request_id
        elif isinstance(event, MotionState):
            key = event.request_id
        if key in self._awaited and not self._awaited[key].done():
            self._awaited[key].set_result(event)
        if self._on_event is not None:
            self._on_event(event)
        else:
            self._events.append(event)
            self._event_there.set()


def _without_codes(error: LinkError) -> LinkError:
    """Explain why a coded tag has no answer: older software does not know the message."""
    return LinkError(
        f"{error.message}; if it answers otherwise, its software knows no coded tags",
        remedy="Update the drone, give it its list itself with `uavrt run --tags`, or send the "
        "beeping tags alone",
    )
