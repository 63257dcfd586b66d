"""Detect data that cannot be radio samples, as from a program that hangs or stutters."""

import numpy as np

from uavrt.core.errors import RadioGarbled, RadioStalled
from uavrt.core.messages import IQBlock

FULL_SCALE_POWER = 4.0
"""Mean power of a block above which the data are not a signal. Full scale is 1 in I and in Q,
so a full-scale square wave has a power of 2; random bytes read as floats have 10⁷⁶."""
DEAD_S = 1.0
"""Duration of exact zeros that shows a dead radio [s]; noise is at least one converter step."""


class SampleCheck:
    """Checks every block of the decimated band by its power: 20 µs for 87 ms of samples."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._dead_s = 0.0

    def check(self, block: IQBlock) -> None:
        """Raise `RadioGarbled` if values are absurd, `RadioStalled` after 1 s of zeros."""
        values = block.samples.view(np.float32)
        if values.size == 0:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            power = 2.0 * float(np.dot(values, values)) / values.size
        if not power <= FULL_SCALE_POWER:  # also NaN
            raise RadioGarbled(
                f"{self._name} sends values that are not samples",
                remedy="Plug the radio in again; check radio.program and its sample format",
            )
        self._dead_s = 0.0 if power else self._dead_s + values.size / 2 / block.sample_rate_hz
        if self._dead_s > DEAD_S:
            raise RadioStalled(
                f"{self._name} sends only zeros", remedy="Plug the radio in again"
            )
