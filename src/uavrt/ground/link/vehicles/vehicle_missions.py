"""Upload surveys as missions to the autopilot, and read its geofence, over the ground's link.

An uploaded mission moves nothing until a pilot starts it. Uploads are refused while the vehicle
flies a mission, since a new mission would change its path.
"""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import CommandRefused, LinkError
from uavrt.core.messages import VehicleFence
from uavrt.guidance.autopilot_behaviour import Behaviour, behaviour_of
from uavrt.guidance.files.mission import MissionItem, difference, fence_of, survey_items
from uavrt.guidance.operator_orders import Limits, Order
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.mission_transfer import (
    MissionDownload,
    MissionTransfer,
    MissionUpload,
    with_home,
)
from uavrt.link.mavlink.autopilot.pose_samples import is_place
from uavrt.link.mavlink.autopilot.vehicle_messages import kind_of
from uavrt.link.mavlink.dialect import MavComponent
from uavrt.link.mavlink.discovery import Peer, request_message
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.message import Message

POLL_S = 0.05
HOME_WITHIN_S, ASKS_EVERY_S = 8.0, 1.0
HEARTBEAT_GAP_S = 5.0
"""Longest time between two heartbeats for which the vehicle counts as in contact [s].
Heartbeats are sent once a second; at 20 % loss, four in a row are lost once in ten minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uploaded:
    """A mission that was uploaded to the vehicle and read back."""

    items: int
    sent_again: int
    strange: int
    """Number of unexpected messages received during the upload and ignored."""


@dataclass(slots=True, kw_only=True)
class _Autopilot:
    heartbeat: dialect.Heartbeat
    heard_s: float


class VehicleMissions:
    """Uploads and downloads missions one at a time; no upload while the vehicle flies one."""

    def __init__(
        self, own: Peer, send: Callable[[Message], None], system_id: Callable[[], int | None]
    ) -> None:
        self._own = (own.system_id, own.component_id)
        self._send, self._system_id = send, system_id
        self._autopilots: dict[int, _Autopilot] = {}
        self._homes: dict[int, tuple[float, float]] = {}
        """Home positions (latitude, longitude) [deg] since the last request, by system id."""
        self._transfer: MissionTransfer | None = None
        self._uploads = False
        self._busy = asyncio.Lock()

    def receive(self, frame: Frame) -> None:
        """Handle an autopilot's frame: heartbeat, home, or an answer to a transfer."""
        if frame.component_id != MavComponent.COMP_ID_AUTOPILOT1:
            return
        message, transfer = frame.message(), self._transfer
        if isinstance(message, dialect.Heartbeat):
            self._autopilots[frame.system_id] = _Autopilot(
                heartbeat=message, heard_s=monotonic_s()
            )
            self._watch()
        elif isinstance(message, dialect.HomePosition):
            if is_place(message.latitude, message.longitude):
                self._homes[frame.system_id] = (message.latitude / 1e7, message.longitude / 1e7)
        elif message is not None and transfer is not None:
            sender = (frame.system_id, frame.component_id)
            self._send_all(transfer.receive(message, sender, monotonic_s()))

    async def wait(self, timeout_s: float) -> None:
        """Wait until an autopilot's message arrives; raises `LinkError` after `timeout_s`."""
        deadline_s = monotonic_s() + timeout_s
        while not self._heard():
            if monotonic_s() > deadline_s:
                raise LinkError(
                    f"no message from an autopilot arrived in {timeout_s:g} s",
                    remedy="Check the autopilot's power, the radio link and the address "
                    "given with --mavlink",
                )
            await asyncio.sleep(POLL_S)

    async def upload_survey(
        self,
        order: Order,
        limits: Limits,
        call: Callable[..., Awaitable[Any]] = asyncio.to_thread,
    ) -> Uploaded:
        """Upload a survey inside the geofence; `call` runs the path check in a thread."""
        await call(survey_items, order, limits)  # what is none needs no vehicle to be refused
        self._check_mode(self._vehicle()[1])
        home, fence = await self.home(), await self.fence()
        known = replace(
            limits, stay_in=fence.within, keep_out=(*limits.keep_out, *fence.keep_out)
        )
        return await self.upload(await call(survey_items, order, known, home))

    async def home(self) -> tuple[float, float]:
        """Query the vehicle's home [deg]; raises `CommandRefused` or `LinkError`."""
        self._homes.clear()
        asks = round(HOME_WITHIN_S / ASKS_EVERY_S)
        for _ in range(asks):
            peer, _manners = self._vehicle()
            self._send(request_message(peer, dialect.HomePosition.ID))
            for _ in range(round(ASKS_EVERY_S / POLL_S)):
                await asyncio.sleep(POLL_S)
                if peer.system_id in self._homes:
                    return self._homes[peer.system_id]
        raise CommandRefused(
            "the home position is unknown, so the geofence cannot be checked",
            remedy="Wait for the vehicle's position, or save the survey and check it in "
            "QGroundControl",
        )

    async def upload(self, items: Sequence[MissionItem]) -> Uploaded:
        """Replace the vehicle's mission, read it back and compare both."""
        async with self._busy:
            peer, behaviour = self._vehicle()
            self._check_mode(behaviour)
            whole = with_home(items, home_first=behaviour.home_in_mission)
            upload = MissionUpload(whole, "mission", peer, self._own)
            self._uploads = True
            try:
                await self._run(upload)
            finally:
                self._uploads = False
            download = MissionDownload("mission", peer, self._own)
            await self._run(download)
            differs = difference(items, download.items[len(whole) - len(items) :])
        if differs is not None:
            raise CommandRefused(
                f"the mission on the vehicle differs from the one sent: {differs}",
                remedy="Do not start the mission that is now on the vehicle; upload the "
                "survey again",
            )
        counted = upload.counters + download.counters
        return Uploaded(
            items=len(items), sent_again=counted["sent_again"], strange=counted["strange"]
        )

    async def fence(self) -> VehicleFence:
        """Read the vehicle's fence; raises `CommandRefused`, `FormatError` or `LinkError`."""
        async with self._busy:
            peer, _ = self._vehicle()
            download = MissionDownload("fence", peer, self._own)
            await self._run(download)
        return fence_of(download.items)

    async def _run(self, transfer: MissionTransfer) -> None:
        self._transfer = transfer
        try:
            while not transfer.over:
                self._send_all(transfer.due(monotonic_s()))
                await asyncio.sleep(POLL_S)
                if self._uploads:
                    self._watch()
        finally:
            self._send_all(transfer.cancel("it was cancelled"))
            self._transfer = None
        if transfer.fault is None:
            return
        if transfer.silent:
            raise LinkError(transfer.fault, remedy="Check the radio link, and try again")
        raise CommandRefused(
            transfer.fault,
            remedy="Wait until the upload has ended before you start a mission on the vehicle",
        )

    def _watch(self) -> None:
        """Abort an upload when the vehicle starts a mission or contact is lost."""
        if self._transfer is None or not self._uploads:
            return
        try:
            _, behaviour = self._vehicle()
            self._check_mode(behaviour)
        except (CommandRefused, LinkError) as error:
            self._send_all(self._transfer.cancel(error.message))
            self._transfer.silent = isinstance(error, LinkError)

    def _vehicle(self) -> tuple[Peer, Behaviour]:
        """Return the autopilot's address and type; raises if none or several answer."""
        heard, ours = self._heard(), self._system_id()
        if ours is not None:
            heard = {number: one for number, one in heard.items() if number == ours}
        if not heard:
            raise LinkError("no contact with the autopilot", remedy="Check the radio link")
        if len(heard) > 1:
            raise CommandRefused(
                f"messages from {len(heard)} autopilots arrive, so the vehicle is ambiguous: "
                f"{', '.join(map(str, sorted(heard)))}",
                remedy="Start uavrt on the vehicle that should get the survey",
            )
        ((number, one),) = heard.items()
        peer = Peer(number, MavComponent.COMP_ID_AUTOPILOT1)
        return peer, behaviour_of(kind_of(one.heartbeat))

    def _heard(self) -> dict[int, _Autopilot]:
        now_s = monotonic_s()
        return {
            number: one
            for number, one in self._autopilots.items()
            if now_s - one.heard_s < HEARTBEAT_GAP_S
        }

    def _check_mode(self, behaviour: Behaviour) -> None:
        peer, _ = self._vehicle()
        mode = self._autopilots[peer.system_id].heartbeat.custom_mode
        if mode in behaviour.mission_modes:
            raise CommandRefused(
                f"the vehicle flies in mode {behaviour.mode_name(mode)}, and another mission "
                "would change its path",
                remedy="Ask the pilot to hold position first",
            )

    def _send_all(self, messages: Sequence[Message]) -> None:
        for message in messages:
            self._send(message)
