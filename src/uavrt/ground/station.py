"""A ground station without a page: uploads tags, starts, stores pulses, stops.

The page of ``uavrt ground`` stands on the same link; this is what a script or a first bench
test needs.
"""

import asyncio
import json
import math
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

from uavrt.clock import Clock, monotonic_s
from uavrt.config import write_tags
from uavrt.errors import CommandRefused, LinkError, RecordingError
from uavrt.ground.link import (
    NO_KEYS,
    Acknowledged,
    DetectorAlive,
    DroneHeartbeat,
    GroundEvent,
    GroundLink,
    LinkKeys,
    open_receipts,
)
from uavrt.ground.store import PULSES_NAME
from uavrt.messages import (
    BurstInside,
    PulsePose,
    SearchReport,
    StatusText,
    SystemState,
    Tag,
)
from uavrt.recording import PulseWriter, inside_record, pulse_record
from uavrt.tunnel import Generation, command_name, digest_in, tag_list_digest

START_RETRY_S = 2.0
QUIET_S = 1.0
"""After the drone has stopped: as long without a pulse means that all have arrived."""
STOP_TIMEOUT_S = 12.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StationSettings:
    """What the station is to do."""

    addresses: tuple[str, ...]
    """Ways to the same drone, the one to prefer first."""
    directory: Path
    tags: tuple[Tag, ...]
    start: bool
    generation: Generation = "G1"
    keys: LinkKeys = NO_KEYS


class Station:
    """One ground station session.

    Parameters
    ----------
    settings : StationSettings
        What to do.
    show : callable
        Called with a dictionary for each event: ``event`` names it, the rest are its values.
    """

    def __init__(
        self, settings: StationSettings, show: Callable[[dict[str, Any]], None]
    ) -> None:
        self._settings = settings
        self._show = show
        self._clock = Clock.start()
        self._stopping = asyncio.Event()
        self._state: SystemState | None = None
        self._last_pulse_s = 0.0
        self._started = False
        self._waits_for = ""
        self.pulses = 0

    def stop(self) -> None:
        """Stop detection if it was started here, take the last pulses in, end."""
        self._stopping.set()

    async def run(self) -> None:
        """Serve until `stop`.

        Raises
        ------
        LinkError
            The link cannot be opened.
        CommandRefused
            The drone refused the tags or the start.
        RecordingError
            The pulses cannot be stored.
        """
        directory = self._settings.directory
        made = not directory.exists()
        try:
            await self._serve()
        except LinkError:
            # A port that does not open leaves no directory for a flight that never was.
            if made and not self.pulses:
                shutil.rmtree(directory, ignore_errors=True)
            raise

    async def _serve(self) -> None:
        with open_store(self._settings.directory) as stream:
            if self._settings.tags:
                # With their names, which do not go to the drone.
                write_tags(self._settings.directory / "tags.toml", self._settings.tags)
            self._writer = PulseWriter(stream, "jsonl")
            link = GroundLink(
                self._clock.now_ns,
                on_event=self._take,
                generation=self._settings.generation,
                receipts=open_receipts(self._settings.directory),
                component_id=self._settings.keys.component_id,
                as_gcs=self._settings.keys.as_gcs,
                key=self._settings.keys.command,
                signing_key=self._settings.keys.signing,
            )
            serve = asyncio.create_task(link.run(*self._settings.addresses))
            work = asyncio.create_task(self._work(link))
            await asyncio.wait({serve, work}, return_when=asyncio.FIRST_COMPLETED)
            for task in (work, serve):
                if not task.done():
                    task.cancel()
                with suppress(asyncio.CancelledError):
                    await task

    async def _work(self, link: GroundLink) -> None:
        await self._begin(link)
        await self._stopping.wait()
        if self._started:
            await self._end(link)

    async def _begin(self, link: GroundLink) -> None:
        """Find the drone, upload and start; a drone that does not answer is tried again."""
        while not self._stopping.is_set():
            try:
                drone = await link.wait_for_drone(START_RETRY_S)
                self._waits_for = ""
                self._show({"event": "drone", "system": drone.system_id})
                if self._settings.tags and not await self._upload(link):
                    return
                if self._settings.start:
                    directory = await link.start_detection()
                    self._started = True
                    self._show({"event": "started", "directory": directory})
                return
            except LinkError as error:
                self._wait_for(str(error))

    def _wait_for(self, reason: str) -> None:
        """Say what is waited for: once, and again when it is something else."""
        if reason != self._waits_for:
            self._waits_for = reason
            self._show({"event": "waiting", "reason": reason})

    async def _upload(self, link: GroundLink) -> bool:
        """Send the tags; False when the drone detects already and there is nothing to start.

        A station that was restarted finds its own tags searched: it goes on as the one that
        started them. Others' it listens to, and leaves alone.
        """
        tags = self._settings.tags
        try:
            await link.upload_tags(tags)
        except CommandRefused as error:
            searched = digest_in(str(error))
            if searched is None:
                raise
            if searched == tag_list_digest(tags):
                self._started = self._settings.start
                link.protocol.tags = {tag.tag_id: tag for tag in tags}
                self._show({"event": "already detecting", "tags": [t.tag_id for t in tags]})
            else:
                self._show({"event": "others detected", "reason": str(error)})
            return False
        self._show({"event": "tags", "count": len(tags)})
        return True

    async def _end(self, link: GroundLink) -> None:
        """Stop detection; wait until the drone has stopped and no pulse comes any more."""
        try:
            await link.stop_detection()
        except (LinkError, CommandRefused) as error:
            self._show({"event": "stop failed", "reason": str(error)})
            return
        self._show({"event": "stopping"})
        deadline_s = monotonic_s() + STOP_TIMEOUT_S
        # The state on the way when the command arrived may still say "has tags".
        await asyncio.sleep(QUIET_S)
        while monotonic_s() < deadline_s:
            quiet = monotonic_s() - self._last_pulse_s > QUIET_S
            if self._state is not SystemState.DETECTING and quiet:
                break
            await asyncio.sleep(0.1)
        self._show({"event": "stopped", "pulses": self.pulses})

    def _take(self, event: GroundEvent) -> None:
        match event:
            case PulsePose():
                self.pulses += 1
                self._last_pulse_s = monotonic_s()
                self._writer.write(_without_nan(event))
                self._show({"event": "pulse", **pulse_record(event)})
            case BurstInside():
                self._writer.write_inside(event)
                self._show({"event": "burst", **inside_record(event)})
            case SearchReport():
                self._show({"event": "searched", "tag_id": event.tag_id})
            case DroneHeartbeat():
                if event.state is not self._state:
                    self._show({"event": "state", "state": event.state and event.state.value})
                self._state = event.state
            case StatusText():
                self._show({"event": "text", "severity": event.severity, "text": event.text})
            case Acknowledged():
                self._show(
                    {
                        "event": "acknowledged",
                        "command": command_name(event.command).upper().replace(" ", "_"),
                        "accepted": event.accepted,
                        "message": event.message,
                    }
                )
            case DetectorAlive():
                pass


def _without_nan(pulse_pose: PulsePose) -> PulsePose:
    """Leave out a pose whose place is unknown."""
    pose = pulse_pose.pose
    if pose is None or math.isfinite(pose.latitude_deg):
        return pulse_pose
    return replace(pulse_pose, pose=None)


def open_store(directory: Path) -> TextIO:
    """Open the file of received pulses for appending.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return (directory / PULSES_NAME).open("a", encoding="utf-8")
    except OSError as error:
        raise RecordingError(
            f"pulses cannot be stored in {directory}: {error.strerror}",
            remedy="Give a writable directory with -o",
        ) from error


def json_line(event: dict[str, Any]) -> str:
    """Write an event as one line of JSON."""
    return json.dumps(event, allow_nan=False)
