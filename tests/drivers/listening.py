"""A ground station that only listens: what has come of a flight, from the drone's start on."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from uavrt.core.clock import Clock
from uavrt.core.messages import PulsePose, StatusText
from uavrt.ground.link.drone_link import GroundLink

SOON_S = 60.0


@asynccontextmanager
async def linked(port: int, **options: Any) -> AsyncIterator[GroundLink]:
    """A ground station's link that receives the drone at a port."""
    link = GroundLink(Clock.start().now_ns, **options)
    task = asyncio.create_task(link.run(f"udpin://127.0.0.1:{port}"))
    try:
        await link.wait_for_drone(SOON_S)
        yield link
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


class Listening:
    """A ground station: what has come from the drone since it was asked last."""

    def __init__(self, drone: Any) -> None:
        self._port = drone.ground_port
        self.pulses: list[PulsePose] = []
        self.texts: list[str] = []

    def listen(self, *until: Callable[[], object]) -> None:
        """Hear the drone until all that is wanted has come."""
        self.pulses.clear()
        asyncio.run(self._listen(until))

    async def _listen(self, until: tuple[Callable[[], object], ...]) -> None:
        try:
            async with asyncio.timeout(SOON_S), linked(self._port, on_event=self._take):
                while not all(one() for one in until):  # noqa: ASYNC110 - any condition
                    await asyncio.sleep(0.05)
        except TimeoutError:
            raise AssertionError(f"{len(self.pulses)} pulses, texts {self.texts}") from None

    def _take(self, event: object) -> None:
        if isinstance(event, PulsePose):
            self.pulses.append(event)
        if isinstance(event, StatusText):
            self.texts.append(event.text)
