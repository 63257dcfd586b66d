"""Check whether all pulses of the flight have their poses, so that it can be closed at once.

A pulse passes the supervisor when a detector has found it, and again with its pose, so the
difference is what is still on its way. What passes before the end of the flight is recorded
with it.
"""

import asyncio

FOUND, POSED = "pulse", "pulse_pose"


class LastPulses:
    """Counts the pulses still waiting for their poses."""

    def __init__(self) -> None:
        self._waiting = 0
        self._posed = asyncio.Event()
        self._posed.set()

    @property
    def waiting(self) -> int:
        """Pulses that wait for their poses; also those that a killed process has lost."""
        return self._waiting

    def flight_started(self) -> None:
        """Forget what an earlier flight has lost; a straggler of it is then not counted."""
        self._waiting = 0
        self._posed.set()

    def passed(self, topic: str) -> None:
        """Note a record that passes."""
        if topic == FOUND:
            self._waiting += 1
            self._posed.clear()
        elif topic == POSED and self._waiting:
            self._waiting -= 1
            if not self._waiting:
                self._posed.set()

    async def posed_within(self, limit_s: float) -> bool:
        """Wait until none waits; False when one still does after `limit_s`."""
        try:
            async with asyncio.timeout(limit_s):
                await self._posed.wait()
        except TimeoutError:
            return False
        return True
