"""Download flights from the drone for the web page, with progress, over the link that the page
has already opened (`uavrt.ground.fetch.ftp_client`).

A downloaded flight is stored as ``NAME_drone`` next to the flights received here, which may
have the same name.
"""

import asyncio
import contextlib
import secrets
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from uavrt.core.errors import LinkError, NotFound, UavrtError, UsageError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import FETCHED_COPY, FLIGHT_PREFIX
from uavrt.ground.fetch.flight_list import drone_flights
from uavrt.ground.fetch.ftp_client import (
    FileClient,
    RemoteEntry,
    fetch_file,
    file_request,
    require_room,
)
from uavrt.ground.fetch.sample_files import is_samples
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.store.drone_directory import is_drone_directory
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import Frame

REPORT_S = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Download:
    """Progress of one flight's download from the drone."""

    flight_id: str
    """Name of the flight on the drone."""
    file: str = ""
    done_bytes: int = 0
    whole_bytes: int | None = None
    """Size of the flight [bytes]; None while the drone's files are being listed."""
    ended: bool = False
    error: str | None = None
    """Reason why the download was aborted; None if it was not."""


class Downloads:
    """Downloads flights from one vehicle over its open link, one at a time."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._vehicle = vehicle
        self._client = FileClient(self._send, vehicle.clock.now_ns, secrets.randbelow(256))
        self._asking = asyncio.Lock()
        self._task: asyncio.Task[None] | None = None
        self._shown_ns = 0
        self.current: Download | None = None

    def receive(self, frame: Frame) -> None:
        """Handle a frame of the link; ignored unless it is from the drone's file server."""
        link = self._vehicle.connection.link
        if frame.message_id != dialect.FileTransferProtocol.ID or link is None:
            return
        drone, own = link.protocol.drone, link.protocol.own
        if drone != Peer(frame.system_id, frame.component_id):
            return
        message = frame.message()
        if isinstance(message, dialect.FileTransferProtocol) and own == Peer(
            message.target_system, message.target_component
        ):
            self._client.receive(message.payload)

    async def flights(self) -> list[dict[str, Any]]:
        """List the flights on the drone, newest first; mark those downloaded already."""
        if self._asking.locked():
            raise LinkError(
                "a download is already running", remedy="Wait until the download has finished"
            )
        async with self._asking:
            names = await drone_flights(self._client)
        return [
            {"flight_id": name, "here": self._is_own(name) or self._complete(name)}
            for name in reversed(names)
        ]

    def start(self, flight_id: str, *, everything: bool = False) -> Download:
        """Start to download a flight, with its recorded samples if `everything` is True."""
        if not flight_id.startswith(FLIGHT_PREFIX) or Path(flight_id).name != flight_id:
            raise NotFound(f"the drone has no flight {flight_id[:80]!r}")
        if self._is_own(flight_id):
            raise UsageError(
                f"{flight_id} is already on this computer, because this is the drone's own "
                "computer"
            )
        if self._task is not None and not self._task.done():
            raise LinkError(
                "a download is already running", remedy="Wait until the download has finished"
            )
        self.current = Download(flight_id=flight_id)
        self._task = asyncio.get_running_loop().create_task(self._fetch(flight_id, everything))
        self._show()
        return self.current

    async def stop(self) -> None:
        """Stop the download; the next attempt continues from the part received so far."""
        task = self._task
        if task is not None and not task.done():
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task

    def record(self) -> dict[str, Any] | None:
        """Progress of the latest download for the page; None before the first download."""
        return None if self.current is None else asdict(self.current)

    async def _fetch(self, flight_id: str, everything: bool) -> None:
        error: str | None = "stopped; what has arrived is kept"
        try:
            async with self._asking:
                tree = await self._client.tree(f"/{flight_id}")
                wanted = [one for one in tree.files if everything or not is_samples(one.path)]
                await self._fetch_files(flight_id, _database_last(wanted))
            error = None
            self._vehicle.feed.note(6, f"{flight_id} downloaded")
            if tree.left_out:
                self._vehicle.feed.note(
                    4, f"{tree.left_out} files of {flight_id} were not downloaded"
                )
        except UavrtError as fault:
            error = str(fault)
            self._vehicle.feed.note(4, f"{flight_id} could not be downloaded: {error}")
        finally:
            assert self.current is not None
            self.current = replace(self.current, ended=True, error=error)
            self._show()

    async def _fetch_files(self, flight_id: str, entries: list[RemoteEntry]) -> None:
        assert self.current is not None
        samples = any(is_samples(entry.path) for entry in entries)
        require_room(entries, self._place(flight_id), samples=samples)
        whole = sum(entry.size or 0 for entry in entries)
        before = 0
        for entry in entries:
            inside = entry.path.removeprefix(f"/{flight_id}/")
            place = self._place(flight_id) / inside
            if not place.resolve().is_relative_to(self._place(flight_id).resolve()):
                raise UsageError(
                    f"the drone listed the file {entry.path[:80]!r}, which is outside its "
                    "flight"
                )

            def show(done: int, size: int, file: str = inside, before: int = before) -> None:
                assert self.current is not None
                self.current = replace(
                    self.current, file=file, done_bytes=before + done, whole_bytes=whole
                )
                now_ns = self._vehicle.clock.now_ns()
                if now_ns - self._shown_ns > REPORT_S * NANOSECONDS_PER_SECOND or done == size:
                    self._shown_ns = now_ns
                    self._show()

            show(0, entry.size or 0)
            await fetch_file(self._client, entry, place, show)
            before += entry.size or 0

    def _send(self, payload: bytes) -> None:
        link = self._vehicle.connection.link
        if link is None or link.protocol.drone is None:
            raise LinkError(
                "No contact with the drone", remedy="Check the drone's power and the radio link"
            )
        link.send(file_request(link.protocol.drone, payload))

    def _place(self, flight_id: str) -> Path:
        return self._vehicle.store.directory / f"{flight_id}{FETCHED_COPY}"

    def _is_own(self, flight_id: str) -> bool:
        """True if the drone side runs on this computer and this flight is in its directory."""
        directory = self._vehicle.store.directory
        here = FlightLayout(directory / flight_id).database.is_file()
        return here and is_drone_directory(directory)

    def _complete(self, flight_id: str) -> bool:
        return FlightLayout(self._place(flight_id)).database.is_file()

    def _show(self) -> None:
        self._vehicle.feed.send("download", self.record())


def _database_last(entries: list[RemoteEntry]) -> list[RemoteEntry]:
    """Sort small files first and the database last, since only a complete flight is listed."""
    return sorted(entries, key=lambda one: (one.path.endswith("/flight.sqlite"), one.size or 0))
