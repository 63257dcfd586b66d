"""Count pulses without a pose, so that a flight is not closed before they have one.

The supervisor forwards each pulse twice: first from its detector, then again with its pose.
"""

import asyncio

FOUND, POSED = "pulse", "pulse_pose"


class LastPulses:
    """Counts the pulses that were forwarded without a pose and not yet again with one."""

    def __init__(self) -> None:
        self.waiting = 0
        """Number of pulses still without a pose, even if a killed process has lost them."""
        self._posed = asyncio.Event()
        self._posed.set()

    def flight_started(self) -> None:
        """Reset the count for a new flight."""
        self.waiting = 0
        self._posed.set()

    def passed(self, topic: str) -> None:
        """Count a forwarded record: a pulse adds one, a pulse with pose subtracts one."""
        if topic == FOUND:
            self.waiting += 1
            self._posed.clear()
        elif topic == POSED and self.waiting:
            self.waiting -= 1
            if not self.waiting:
                self._posed.set()

    async def posed_within(self, limit_s: float) -> bool:
        """Wait until each pulse has a pose; False if `limit_s` passes first."""
        try:
            async with asyncio.timeout(limit_s):
                await self._posed.wait()
        except TimeoutError:
            return False
        return True
