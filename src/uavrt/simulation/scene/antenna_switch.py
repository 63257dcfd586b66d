"""An antenna switch, which connects one receiver to several antennas in turn.

It changes the antenna several times during each pulse. The receiver's sample clock controls the
switch, so the antenna of every sample is known exactly and stored in a recording's metadata
(docs/reference/scenario.md). The arithmetic is independent of
`uavrt.localization.bearing.array_bearings`, because it is used to check that module.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.record import ScenarioRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaSwitch(ScenarioRecord):
    """Antenna switch of a scenario: table ``[antenna.switch]``."""

    kind: Literal["circle", "pair", "sum_difference"] = "circle"
    """Arrangement of the antennas: a circle, a pair (left and right), or sum and difference of
    a pair."""
    elements: Annotated[int, Ge(3), Le(16)] = 4
    """Number of antennas on a circle; the first points ahead, the others follow clockwise."""
    size_m: Annotated[float, Gt(0), Le(5)] = 0.4
    """Radius of the circle of antennas, or distance between a pair's antennas [m]."""
    dwell_s: Annotated[float, Gt(0), Le(0.01)] = 250e-6
    """Time at each switch position [s], rounded to whole samples."""
    settle_s: Annotated[float, Ge(0), Le(0.005)] = 20e-6
    """Time without a signal at the start of each switch position [s]."""

    @property
    def positions(self) -> int:
        """Number of switch positions."""
        return self.elements if self.kind == "circle" else 2

    def dwell_samples(self, sample_rate_hz: float) -> int:
        """Number of samples at each switch position, including settling."""
        return max(1, round(self.dwell_s * sample_rate_hz))

    def settle_samples(self, sample_rate_hz: float) -> int:
        """Number of samples without a signal at the start of each switch position."""
        settle = math.ceil(self.settle_s * sample_rate_hz)
        return min(settle, self.dwell_samples(sample_rate_hz) - 1)

    def metadata(self, sample_rate_hz: float) -> dict[str, Any]:
        """Description of the switch for a recording's metadata.

        It determines which antenna received each sample.
        """
        return {
            "kind": self.kind,
            "positions": self.positions,
            "size_m": self.size_m,
            "first_sample": 0,
            "dwell_samples": self.dwell_samples(sample_rate_hz),
            "settle_samples": self.settle_samples(sample_rate_hz),
        }


def position_weights(
    switch: AntennaSwitch, direction_body: geometry.Vector, wavelength_m: float
) -> NDArray[np.complex128]:
    """Complex amplitude of a plane wave at each switch position.

    `direction_body`: unit vector in the drone's frame (FRD) towards the source.
    """
    turns_per_m = 1.0 / wavelength_m
    if switch.kind == "circle":
        weights = []
        for element in range(switch.elements):
            angle = 2.0 * math.pi * element / switch.elements
            place = (switch.size_m * math.cos(angle), switch.size_m * math.sin(angle), 0.0)
            turns = geometry.dot(place, direction_body) * turns_per_m
            weights.append(np.exp(2j * math.pi * turns))
        return np.array(weights, np.complex128)
    half = math.pi * switch.size_m * direction_body[1] * turns_per_m
    left, right = np.exp(-1j * half), np.exp(1j * half)
    if switch.kind == "pair":
        return np.array([left, right], np.complex128)
    # A lossless hybrid: each output holds half of the power of both antennas together.
    return np.array([right + left, right - left], np.complex128) / math.sqrt(2.0)


def gate(
    switch: AntennaSwitch,
    weights: NDArray[np.complex128],
    first_sample: int,
    count: int,
    sample_rate_hz: float,
) -> NDArray[np.complex64]:
    """Weights of a wave at consecutive samples, shape (count,); 0 while the switch settles."""
    dwell = switch.dwell_samples(sample_rate_hz)
    step, within = np.divmod(first_sample + np.arange(count), dwell)
    factor: NDArray[np.complex64] = weights[step % switch.positions].astype(np.complex64)
    factor[within < switch.settle_samples(sample_rate_hz)] = 0.0
    return factor
