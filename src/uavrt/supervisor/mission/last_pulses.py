"""Checks whether all pulses of the flight have their poses, so that it can be closed.

A pulse passes the supervisor from its detector, and again with its pose; the difference is on
its way.
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
        """Number of pulses without their pose, also those lost with a killed process."""
        return self._waiting

    def flight_started(self) -> None:
        """Reset for a new flight; late pulses of the last are not counted."""
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
        """Wait until all pulses have poses; False if not after `limit_s`."""
        try:
            async with asyncio.timeout(limit_s):
                await self._posed.wait()
        except TimeoutError:
            return False
        return True
