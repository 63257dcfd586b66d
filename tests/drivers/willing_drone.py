"""A whole drone in real time, for ground stations that run as separate programs."""

import asyncio
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from made import pose

from uavrt.core.commands import SystemState
from uavrt_experiments.autopilots.measures import is_motion
from world import THESIS_TAG, World

OUR_COMPONENT = (1, 191)


class WillingDrone:
    """The world's drone and autopilot in a thread; its own files go when it closes.

    It hovers 40 m above 46.5° N 8° E, nose east; each further vehicle is 110 m farther north.
    Further arguments are those of `World`: with `guidance` and `flies` it takes orders.
    """

    def __init__(self, port: int, system_id: int = 1, **world: Any) -> None:
        self._files = tempfile.TemporaryDirectory()
        north_deg = 0.001 * (system_id - 1)
        self.world = World(
            Path(self._files.name),
            ground_port=port,
            system_id=system_id,
            mavlink={"attitude_rate_hz": 10.0},
            vehicle=lambda time_ns: pose(time_ns, 46.5 + north_deg, yaw_deg=90.0),
            **world,
        )
        self.commands = 0
        """Commands of motion that the drone has given to its autopilot."""
        self._count_commands()
        self._loop: asyncio.AbstractEventLoop
        self._closing: asyncio.Event
        self._alive = threading.Event()
        self._thread = threading.Thread(target=asyncio.run, args=(self._live(),))
        self._thread.start()
        assert self._alive.wait(60.0), "the drone does not start"

    async def _live(self) -> None:
        self._loop, self._closing = asyncio.get_running_loop(), asyncio.Event()
        async with self.world.alive():
            self._alive.set()
            await self._closing.wait()

    def _count_commands(self) -> None:
        autopilot = self.world.autopilot
        obey = autopilot._command

        def command(side: Any, message: Any, sender: tuple[int, int]) -> None:
            obey(side, message, sender)
            self.commands += sender == OUR_COMPONENT and is_motion(message)

        autopilot._command = command  # type: ignore[method-assign]

    def _do(self, action: Callable[[], object]) -> None:
        async def done() -> None:
            action()

        asyncio.run_coroutine_threadsafe(done(), self._loop).result(60.0)

    @property
    def state(self) -> SystemState:
        state: SystemState = self.world.mission.state
        return state

    @state.setter
    def state(self, wanted: SystemState) -> None:
        """Bring the drone into a state without a ground station; nothing where it is in it."""
        leads = {
            SystemState.HAS_TAGS: self.world.take_tags,
            SystemState.DETECTING: self.world.detect,
        }
        if wanted is not self.state:
            self._do(lambda: leads[wanted](THESIS_TAG))

    @property
    def tags(self) -> int:
        """Tags of the last list."""
        return len(self.world.mission.upload.tags)

    def close(self) -> None:
        """Stop the drone and its thread."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._closing.set)
            self._thread.join(60.0)
            self._files.cleanup()
