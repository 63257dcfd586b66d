"""Are all pulses of the flight safe? Then it can be closed, without waiting longer.

A pulse passes the supervisor when a detector has found it, and again when the recorder has it
on disk with its pose, so the difference is what is still on its way.
"""

import asyncio

FOUND, SAFE = "pulse", "recorded_pulse_pose"


class LastPulses:
    """Counts the pulses between the detectors and the disk."""

    def __init__(self) -> None:
        self._waiting = 0
        self._safe = asyncio.Event()
        self._safe.set()

    @property
    def waiting(self) -> int:
        """Pulses that are on their way; also those that a killed process has lost."""
        return self._waiting

    def flight_started(self) -> None:
        """Forget what an earlier flight has lost; a straggler of it is then not counted."""
        self._waiting = 0
        self._safe.set()

    def passed(self, topic: str) -> None:
        """Take note of a record that passes."""
        if topic == FOUND:
            self._waiting += 1
            self._safe.clear()
        elif topic == SAFE and self._waiting:
            self._waiting -= 1
            if not self._waiting:
                self._safe.set()

    async def safe_within(self, limit_s: float) -> bool:
        """Wait until none is on its way; False when one still is after `limit_s`."""
        try:
            async with asyncio.timeout(limit_s):
                await self._safe.wait()
        except TimeoutError:
            return False
        return True
