"""Connect `uavrt fetch` to the drone over the fastest of several links, as a component of the
ground's system and not as a ground station, so that the drone sends it no pulses.
"""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from uavrt.core.errors import LinkError
from uavrt.ground.fetch.ftp_client import FileClient, file_request
from uavrt.ground.link.requests.parallel_links import DroneLinks
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.mavlink.discovery import STATION_SYSTEM_ID, Peer, own_heartbeat
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.sending.signing import Signing, SigningKey

HEARTBEAT_S = 1.0
OWN_COMPONENT = 197
"""MAVLink component id of `uavrt fetch`; different from the ground station's, 190."""
PINGS = 4
PING_S = 0.25


class DroneFiles:
    """Links to the drone that transfer only files.

    The fastest of several links is used, and the next one if it does not answer.

    ::

        async with DroneFiles(clock.now_ns).open("udpin://127.0.0.1:14550") as client:
            for entry in (await client.tree("/")).files:
                await fetch_file(client, entry, Path(entry.path.lstrip("/")))

    `signing_key`: signs frames, see `uavrt.link.mavlink.sending.signing`.
    """

    def __init__(
        self,
        now_ns: Callable[[], int],
        *,
        signing_key: SigningKey | None = None,
    ) -> None:
        self._now_ns = now_ns
        self._own = Peer(STATION_SYSTEM_ID, OWN_COMPONENT)
        self._signing = None if signing_key is None else Signing(signing_key, now_ns)
        self._links = DroneLinks(self._own.place, self._receive, now_ns, signing=self._signing)
        self._drone: Peer | None = None
        self._found = asyncio.Event()
        self._trips_ns: dict[int, int] = {}
        self.link = 0
        """Index of the MAVLink link over which files are fetched."""
        self._client = FileClient(
            self._send, now_ns, session=secrets.randbelow(256), unanswered=self._next_link
        )

    @asynccontextmanager
    async def open(self, *addresses: str, timeout_s: float = 20.0) -> AsyncIterator[FileClient]:
        """Open the links, find the drone, and select the fastest link; raises `LinkError`."""
        tasks = await self._links.open(addresses)
        tasks.append(asyncio.create_task(self._send_heartbeat()))
        try:
            await self._find(timeout_s)
            if len(addresses) > 1:
                await self._compare(len(addresses))
            yield self._client
        finally:
            for task in tasks:
                task.cancel()
            await self._links.close()

    async def _find(self, timeout_s: float) -> None:
        if not await within(timeout_s, self._found.wait()):
            raise LinkError(
                f"no message from a drone arrived in {timeout_s:g} s (MAVLink component "
                f"{DRONE_COMPONENT})",
                remedy="Check the drone's power and the radio, and that the autopilot "
                "forwards MAVLink",
            )

    async def _compare(self, links: int) -> None:
        """Ping the drone over every link, and use the link with the shortest round trip."""
        for number in range(PINGS):
            for link in range(links):
                ping = dialect.Ping(
                    time_usec=self._now_ns() // 1000,
                    seq=PINGS * link + number,
                    target_system=0,
                    target_component=0,
                )
                self._links.send(ping, link)
            await asyncio.sleep(PING_S)
        if self._trips_ns:
            self.link = min(self._trips_ns, key=self._trips_ns.__getitem__)

    def _next_link(self) -> None:
        """Use another link on which the drone's frames arrive, if there is one."""
        others = [link for link in self._links.alive() if link != self.link]
        if others:
            later = [link for link in others if link > self.link]
            self.link = (later or others)[0]

    async def _send_heartbeat(self) -> None:
        """Send a heartbeat once a second, so that the autopilot routes messages to this
        program.
        """
        message = own_heartbeat(dialect.MavType.GENERIC)
        while True:
            self._links.send_by_all(message)
            await asyncio.sleep(HEARTBEAT_S)

    def _receive(self, frame: Frame, link: int) -> None:
        if frame.component_id != DRONE_COMPONENT:
            return
        if self._signing is not None and not self._signing.accepts(frame):
            return
        message = frame.message()
        self._links.drone_received(link, pulse=False)
        if isinstance(message, dialect.Heartbeat):
            if self._drone is None:
                self.link = link
            self._drone = Peer(frame.system_id, frame.component_id)
            self._found.set()
        elif isinstance(message, dialect.Ping) and self._is_ours(message):
            passed_ns = self._now_ns() - message.time_usec * 1000
            self._trips_ns[link] = min(passed_ns, self._trips_ns.get(link, passed_ns))
        elif isinstance(message, dialect.FileTransferProtocol) and self._is_ours(message):
            self._client.receive(message.payload)

    def _is_ours(self, message: dialect.Ping | dialect.FileTransferProtocol) -> bool:
        return self._own == Peer(message.target_system, message.target_component)

    def _send(self, payload: bytes) -> None:
        if self._drone is not None:
            self._links.send(file_request(self._drone, payload), self.link)
