"""Open, close and reopen the MAVLink link of one vehicle."""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import NoReturn

from uavrt.core.errors import LinkError, RecordingError, UavrtError
from uavrt.core.messages import Tag
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.received.feed import Feed
from uavrt.ground.link.stored_pulses import open_receipts
from uavrt.ground.link.vehicles.vehicle_identity import VehicleIdentity
from uavrt.ground.link.vehicles.vehicle_state import VehicleWatch
from uavrt.ground.store.ground_settings import GroundStore


class Connection:
    """Keeps the MAVLink link to one vehicle; `make_link` makes it from keyword arguments."""

    def __init__(
        self,
        store: GroundStore,
        feed: Feed,
        identity: VehicleIdentity,
        make_link: Callable[..., GroundLink],
    ) -> None:
        self.link: GroundLink | None = None
        self.watch: VehicleWatch | None = None
        """State of the vehicle's autopilot; None without a link."""
        self.error: str | None = None
        """Reason why the link could not be opened; None while it is open."""
        self._store = store
        self._feed = feed
        self._identity = identity
        self._make_link = make_link
        self._receipts: Receipts | None = None
        self._serving: asyncio.Task[None] | None = None
        self._faults_reported = 0

    @property
    def is_open(self) -> bool:
        """True while frames can be sent."""
        return self.link is not None and self.link.link is not None

    @property
    def flies(self) -> bool:
        """True if the vehicle has an autopilot; False for a mast or a person on foot."""
        return self.watch is not None and self.watch.autopilot is not None

    def present(self, now_ns: int) -> bool:
        """True while the drone is in contact."""
        return self.link is not None and self.link.protocol.present(now_ns)

    async def open(self, tags: Callable[[], Sequence[Tag]]) -> None:
        """Open the link from the settings; raises `LinkError`.

        `tags`: function that returns the tags sent to the drone.
        """
        settings = self._store.settings
        if self._receipts is None:  # once: a link is opened again while the disk hangs, too
            disk = self._store.disk
            try:
                self._receipts = await disk.run(open_receipts, self._store.own, disk)
            except RecordingError as error:
                self._fail(error)
        link = self._make_link(
            generation=settings.generation, receipts=self._receipts, identity=self._identity
        )
        link.protocol.set_tags(tags())
        self.watch = VehicleWatch(link.protocol.own, self._identity)
        joins = self._store.system_id is not None
        addresses = () if joins else settings.address.split()
        self._serving = task = asyncio.create_task(link.run(*addresses))
        for _ in range(200):
            if joins or task.done() or link.link is not None:
                break
            await asyncio.sleep(0.01)
        if task.done() and (fault := task.exception()) is not None:
            self._serving = None
            self._fail(fault)
        self.link, self.error = link, None
        self._faults_reported = 0
        if not joins:
            self._feed.note(6, f"connected to {settings.address}")
        self._feed.send_state()

    def _fail(self, error: BaseException) -> NoReturn:
        """Store the reason of a failure in `error`, and raise it."""
        self.error = str(error)
        self._feed.note(3, self.error)
        self._feed.send_state()
        raise LinkError(self.error) from error

    async def close(self) -> None:
        """Close the link to the vehicle."""
        if self._serving is not None:
            self._serving.cancel()
            with contextlib.suppress(asyncio.CancelledError, UavrtError):
                await self._serving
        self.link = self._serving = self.watch = None

    def serve(self, now_ns: int) -> VehicleWatch | None:
        """Send due requests to the vehicle; return its state, None if the link is closed."""
        if self._serving is not None and self._serving.done():
            # A link that was given up for another has no exception, and raises when asked.
            ended = None if self._serving.cancelled() else self._serving.exception()
            self.error = str(ended or "closed")
            self.link = self._serving = self.watch = None
        link, watch = self.link, self.watch
        if link is None or link.link is None or watch is None:
            return None
        for message in (*watch.requests(now_ns), *watch.questions(now_ns), watch.ping(now_ns)):
            link.send(message)
        return watch

    def report_faults(self) -> None:
        """Log how many frames could not be handled: the first, then at each doubling."""
        faults = 0 if self.link is None else self.link.faults
        if faults.bit_length() > self._faults_reported.bit_length():
            self._faults_reported = faults
            text = f"{faults} frames could not be handled: see this program's log"
            self._feed.note(3, text)

    def forget_vehicle(self) -> None:
        """Clear the previous vehicle's state, as another one on this link is now served."""
        if self.link is not None:
            self.link.protocol.forget()
            self.watch = VehicleWatch(self.link.protocol.own, self._identity)
