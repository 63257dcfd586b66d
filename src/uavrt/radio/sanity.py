"""Can these be samples of a radio? A program may hang, stutter or write something else."""

import numpy as np

from uavrt.errors import RadioGarbled, RadioStalled
from uavrt.messages import IQBlock

FULL_SCALE_POWER = 4.0
"""Mean power of a block that no radio gives: its full scale is 1 in each of I and Q, so 2 is a
square wave at both stops. Random bytes read as floats give 10⁷⁶."""
DEAD_S = 1.0
"""Exact zeros for so long: the receiver's own noise is at least one step of its converter."""


class SampleCheck:
    """Looks at every block of the decimated band; one dot product each, 20 µs for 87 ms.

    `name` is what to call the source in errors.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._dead_s = 0.0

    def look(self, block: IQBlock) -> None:
        """Check a block, before it goes to the detectors.

        Raises `RadioGarbled`: these cannot be samples.
        Raises `RadioStalled`: only zeros come.
        """
        values = block.samples.view(np.float32)
        if values.size == 0:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            power = 2.0 * float(np.dot(values, values)) / values.size
        if not power <= FULL_SCALE_POWER:  # also NaN
            raise RadioGarbled(
                f"{self._name} gives values that are not samples",
                remedy="Plug the radio in again; check radio.program and its sample format",
            )
        self._dead_s = 0.0 if power else self._dead_s + values.size / 2 / block.sample_rate_hz
        if self._dead_s > DEAD_S:
            raise RadioStalled(
                f"{self._name} gives only zeros", remedy="Plug the radio in again"
            )
