"""Correct the path loss for reflection by the ground."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.planning.tuning import PLANNING

_Floats = NDArray[np.floating[Any]]


@dataclass(slots=True, kw_only=True)
class GroundReflection:
    """Level correction for the ray that is reflected by ground of medium conductivity,
    tabulated over the distance.
    """

    frequency_hz: float = 150e6
    tag_height_m: float = 1.0
    permittivity: float = 15.0
    conductivity_s_m: float = 5e-3
    farthest_m: float = 4000.0
    _tables: dict[float, NDArray[np.float32]] = field(default_factory=dict)

    def gain_db(self, ground_m: _Floats, height_m: float) -> _Floats:
        """Level of direct and reflected ray together, relative to the direct ray [dB];
        `height_m` is the drone's height above the tag.
        """
        drone_m = height_m + self.tag_height_m
        straight = np.hypot(ground_m, height_m)
        mirrored = np.hypot(ground_m, drone_m + self.tag_height_m)
        sine = (drone_m + self.tag_height_m) / mirrored
        ratio = complex(self.permittivity, -18e9 * self.conductivity_s_m / self.frequency_hz)
        root = np.sqrt(ratio - (1.0 - sine**2))
        coefficient = (sine - root) / (sine + root)
        phase = 2.0 * np.pi * self.frequency_hz / SPEED_OF_LIGHT_M_S * (mirrored - straight)
        both = np.abs(1.0 + coefficient * np.exp(-1j * phase))
        return np.asarray(20.0 * np.log10(np.maximum(both, 1e-3)))

    def __call__(self, dx: _Floats, dy: _Floats, height_m: _Floats | float) -> _Floats:
        """Level of direct and reflected ray together, relative to the direct ray [dB], for
        offsets east, north and a height [m].
        """
        height = round(float(np.mean(height_m)), 1)
        table = self._tables.get(height)
        if table is None:
            places = np.arange(0.0, self.farthest_m, PLANNING.table_step_m)
            table = self.gain_db(places, height).astype(np.float32)
            self._tables[height] = table
        ground = np.sqrt(dx * dx + dy * dy)
        place = np.minimum(ground * (1.0 / PLANNING.table_step_m) + 0.5, len(table) - 1)
        return np.asarray(table[place.astype(np.int32)])
