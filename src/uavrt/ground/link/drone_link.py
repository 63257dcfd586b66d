"""Ground side of the tunnel over MAVLink: find the drone, upload tags, start, stop.
`GroundProtocol` encodes and decodes; `GroundLink` exchanges the messages.
"""

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from uavrt.core.commands import NO_UPLOAD, CommandName, Generation
from uavrt.core.errors import CommandRefused, LinkError, RecordingError
from uavrt.core.log import get_logger
from uavrt.core.messages import Neighbour, Tag
from uavrt.core.units import ns_from_s
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.protocol import Acknowledged, GroundEvent, GroundProtocol
from uavrt.ground.link.requests.command_payloads import CommandEncoder
from uavrt.ground.link.requests.drone_parameters import DroneParameters
from uavrt.ground.link.requests.parallel_links import DroneLinks, Links
from uavrt.ground.link.requests.pending_commands import ACK_WAIT_S, Exchange
from uavrt.ground.link.stored_pulses import new_store
from uavrt.ground.link.vehicles.drone_contact import DroneContact
from uavrt.ground.link.vehicles.vehicle_identity import VehicleIdentity
from uavrt.ground.link.vehicles.vehicle_missions import VehicleMissions
from uavrt.link.mavlink.dialect import FileTransferProtocol, Tunnel
from uavrt.link.mavlink.discovery import GCS_SYSTEM_ID, STATION_SYSTEM_ID, Peer
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.signing import Signing, SigningKey
from uavrt.link.tunnel.gate import Sealer
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.own_messages.coded_tag import CODED_TAG_TYPE
from uavrt.link.tunnel.own_messages.motion_messages import MotionState
from uavrt.link.tunnel.own_messages.neighbour_messages import encode_neighbour
from uavrt.link.tunnel.own_messages.private import MAX_SEALED_HASHES, NEIGHBOUR_TYPE
from uavrt.link.tunnel.own_messages.seal import Key

log = get_logger()

HEARTBEAT_S = 1.0
RECEIPT_POLL_S = 0.05


class GroundLink:
    """A ground station's link to the drone.

    Commands raise `CommandRefused` with the drone's reason, or `LinkError` without an answer.

    ::

        link = GroundLink(clock.now_ns, on_event=print)
        task = asyncio.create_task(link.run("udpin://127.0.0.1:14550"))
        await link.wait_for_drone(30.0)
        await link.upload_tags(tags)
        await link.start_detection()

    `on_event`: called at once with each event.
    `generation`: protocol version of the drone's software.
    `system_id`, `component_id`: our own ids; 254/190, or 255/190 with `as_gcs`.
    `as_gcs`: identify as a ground station of type GCS, which the original's drone side
    requires.
    `ack_wait_s`: wait for an acknowledgement before the command is repeated [s].
    `on_frame`: called with every frame of the link, also the autopilot's and the radio's.
    `receipts`: pulses that the station has stored; None: the drone sends its whole flight.
    `progress`: returns how many pulses `on_event` has accepted, and how many of them are
    durable. Durable ones are acknowledged, except those for which `on_event` raised
    `RecordingError`. None: a pulse is acknowledged when `on_event` returns.
    `key`: authenticates commands and receipts, see `uavrt.link.tunnel.own_messages.seal`.
    `signing_key`: signs frames, see `uavrt.link.mavlink.sending.signing`; unsigned frames are
    then accepted from the autopilot only.
    `identity`: selects the served vehicle; None: the first one received.
    `links`: links shared with the sessions of other vehicles.
    """

    def __init__(
        self,
        clock_ns: Callable[[], int],
        *,
        on_event: Callable[[GroundEvent], None] = lambda _event: None,
        generation: Generation = "G1",
        system_id: int | None = None,
        component_id: int = 190,
        as_gcs: bool = False,
        ack_wait_s: float = ACK_WAIT_S,
        on_frame: Callable[[Frame], None] = lambda _frame: None,
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
        self.writing = CommandEncoder(generation)
        signing = None if signing_key is None else Signing(signing_key, clock_ns)
        self._links = DroneLinks(
            (system_id, component_id), self._receive, clock_ns, signing=signing, links=links
        )
        self.contact = DroneContact(signing)
        self._exchange = Exchange(
            self.protocol, self._links, self.contact, clock_ns, ack_wait_s
        )
        self.parameters = DroneParameters(self.protocol, self.send, ack_wait_s)
        """Lists and sets the drone's parameters."""
        self.missions = VehicleMissions(self.protocol.own, self.send, self._vehicle_id)
        """Uploads and downloads the autopilot's mission and fence."""

    @property
    def link(self) -> Link | None:
        """The first MAVLink link that is open; None without one."""
        return next(iter(self._links.links), None)

    async def run(self, *addresses: str) -> None:
        """Serve the links until cancelled.

        `addresses`: links to the same drone, the preferred one first. Those that cannot be
        opened are tried again as long as one is open. None: use the links that another session
        has opened, which also sends their heartbeats.
        Raises `ConfigError`: an address is invalid.
        Raises `LinkError`: none could be opened.
        """
        try:
            opening = await self._links.open(addresses)
        except BaseException:
            await self._links.close(opened=bool(addresses))
            raise
        try:
            next_heartbeat_ns = turn = 0
            while True:
                now_ns = self._clock_ns()
                if addresses and now_ns >= next_heartbeat_ns:
                    next_heartbeat_ns = now_ns + ns_from_s(HEARTBEAT_S)
                    self._links.send_by_all(self.protocol.heartbeat())
                self._acknowledge()
                receipt = self.protocol.receipt(now_ns)
                if receipt is not None:
                    self._links.answer(receipt)
                links = self._links.alive() or self._links.best()
                for message in self.protocol.keepalives(len(links), now_ns):
                    self._links.send(message, links[turn % len(links)])
                    turn += 1
                await asyncio.sleep(RECEIPT_POLL_S)
        finally:
            for task in opening:
                task.cancel()
            await self._links.close(opened=bool(addresses))

    async def wait_for_drone(self, timeout_s: float) -> Peer:
        """Wait for a message of the drone (component 191); raises `LinkError` after
        `timeout_s`.
        """
        await self.contact.wait(timeout_s)
        assert self.protocol.drone is not None
        return self.protocol.drone

    def _vehicle_id(self) -> int | None:
        """System id of the served vehicle; None until it is known."""
        drone = self.protocol.drone
        return self.protocol.identity.system_id if drone is None else drone.system_id

    async def upload_tags(
        self, tags: Sequence[Tag], progress: Callable[[int, int], None] | None = None
    ) -> None:
        """Replace the drone's tag list by this one; each message is acknowledged."""
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
                    "the drone began the upload and then refused it: two vehicles use "
                    f"number {self._vehicle_id()}, or another station has ended the "
                    "upload",
                    remedy="Give each vehicle a number of its own (SYSID_THISMAV, MAV_SYS_ID)",
                ) from error
            if progress is not None:
                progress(count, len(payloads))
        self.protocol.set_tags(tags)

    async def correct_tag(self, tag: Tag) -> str:
        """Replace a tag while detection runs; return the drone's message."""
        answer = await self.command(self.writing.correction(tag))
        self.protocol.tags[tag.tag_id] = tag
        return answer.message

    async def start_detection(
        self,
        *,
        center_frequency_hz: float | None = None,
        gain: int = 0,
        name: CommandName = "start_detection",
    ) -> str:
        """Start detection, or a raw capture by its `name`; return the flight directory."""
        payload = self.writing.start(center_frequency_hz, gain, name)
        return (await self.command(payload)).message

    async def stop_detection(self) -> None:
        """Stop detection, and wait for the drone's acknowledgement."""
        await self.ask("stop_detection")

    async def ask(
        self, name: CommandName, values: Mapping[str, float | None] = MappingProxyType({})
    ) -> str:
        """Send a command with values in its fields; return the drone's message."""
        return (await self.command(self.writing.command(name, values))).message

    async def command(self, payload: bytes, payload_type: int = PAYLOAD_TYPE) -> Acknowledged:
        """Send a command until it is acknowledged; see `Exchange.command`."""
        request_id = self.writing.request_id_of(payload)
        return await self._exchange.command(payload, payload_type, request_id)

    async def motion(self, payload: bytes, request_id: int) -> MotionState:
        """Send a motion order, a confirmation or a stop; see `Exchange.motion`."""
        return await self._exchange.motion(payload, request_id)

    def send_neighbour(self, neighbour: Neighbour) -> None:
        """Send this drone a report about another drone; before contact, nothing is sent."""
        with contextlib.suppress(LinkError):
            payload = encode_neighbour(neighbour)
            self.send(self.protocol.tunnel_message(payload, NEIGHBOUR_TYPE))

    @property
    def faults(self) -> int:
        """Number of frames that could not be handled, on all links."""
        return sum(link.counters.faults for link in self._links.links)

    def send(self, message: Message) -> None:
        """Send a message that needs no acknowledgement."""
        if isinstance(message, FileTransferProtocol):
            self.protocol.files_asked_ns = self._clock_ns()
        self._links.send(message)

    def _receive(self, frame: Frame, link: int) -> None:
        if not self.contact.accepts(frame):
            return
        self._on_frame(frame)
        self.parameters.receive(frame)
        self.missions.receive(frame)
        try:
            for event in self.protocol.receive(frame, self._clock_ns()):
                self._exchange.receive(event)
                self._on_event(event)
            self.protocol.accepted(self._progress()[0])
            self._acknowledge()
        except RecordingError as error:  # it comes again, as it is not acknowledged
            self.protocol.counters["not_stored"] += 1
            log.seldom(self.protocol.counters["not_stored"], "not stored", reason=str(error))
        if self.protocol.drone is not None:
            self.contact.made.set()
            if Peer(frame.system_id, frame.component_id) == self.protocol.drone:
                self._links.drone_received(link, pulse=frame.message_id == Tunnel.ID)

    def _acknowledge(self) -> None:
        """Add pulses to the next receipt, because they are now stored on disk."""
        self.protocol.stored(self._progress()[1])


def _without_codes(error: LinkError) -> LinkError:
    """Explain a missing answer about a coded tag: older drone software lacks that message."""
    return LinkError(
        f"{error.message}; if it answers other commands, its software does not support coded "
        "tags",
        remedy="Update the drone, give the list on the drone (`uavrt run --tags`), or send "
        "only the tags without codes",
    )
