"""Count pulses that have no pose yet, so that a flight is closed only when all have one.

The supervisor forwards each pulse twice: from its detector, and again with its pose.
"""

import asyncio

FOUND, POSED = "pulse", "pulse_pose"


class LastPulses:
    """Counts the pulses that still wait for their poses."""

    def __init__(self) -> None:
        self._waiting = 0
        self._posed = asyncio.Event()
        self._posed.set()

    @property
    def waiting(self) -> int:
        """Number of pulses without a pose, including pulses lost with a killed process."""
        return self._waiting

    def flight_started(self) -> None:
        """Reset the count for a new flight."""
        self._waiting = 0
        self._posed.set()

    def passed(self, topic: str) -> None:
        """Count a forwarded record: a pulse adds one, a pulse with pose subtracts one."""
        if topic == FOUND:
            self._waiting += 1
            self._posed.clear()
        elif topic == POSED and self._waiting:
            self._waiting -= 1
            if not self._waiting:
                self._posed.set()

    async def posed_within(self, limit_s: float) -> bool:
        """Wait until all pulses have poses; False if some have none after `limit_s`."""
        try:
            async with asyncio.timeout(limit_s):
                await self._posed.wait()
        except TimeoutError:
            return False
        return True
