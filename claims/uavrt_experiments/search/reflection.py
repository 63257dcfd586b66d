"""Effect of the ray that the ground around a tag reflects: many kinds of ground and of tags.

Ground of any permittivity, smooth, rough, sloping or uneven, and a tag whose antenna hangs at
any angle. It uses no code of the filters.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.simulation.scene.propagation import Propagation, ground_reflection

_Floats = NDArray[np.float64]
FREQUENCY_HZ = 150e6
_WAVE_M = SPEED_OF_LIGHT_M_S / FREQUENCY_HZ
_WAVES = 24
"""Number of random waves that make uneven ground."""
_LEAST_HEIGHT_M = 0.05
"""Least height of a tag above uneven ground [m]."""
_LEAST_GRAZING = 0.01
"""Least sine of the angle between ray and ground; a slope does not hide the drone."""
_LEAST_SUM = 1e-3
"""Least sum of the rays' amplitudes, as a share of the direct ray."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reflection:
    """Ground that reflects, and the polarization of the tags above it."""

    permittivity: float = 15.0
    """Relative permittivity: 4 for dry sand, 15 for medium ground, 30 for wet ground."""
    polarization: Literal["horizontal", "vertical", "mixed", "dipole"] = "horizontal"
    """Polarization of a tag's waves. "mixed": any mixture of both, drawn for each tag.
    "dipole": that of a short dipole whose axis has any direction, drawn for each tag."""
    roughness_m: float = 0.0
    """Standard deviation of the ground's height within the reflecting area [m]."""
    slope_deg: float = 0.0
    """Slope of the ground around each tag, towards a drawn direction [°]."""
    uneven_m: float = 0.0
    """Standard deviation of the ground's height from one reflecting area to another [m]."""
    uneven_length_m: float = 10.0
    """Distance over which heights of uneven ground lose their correlation [m]."""


class ReflectedRays:
    """The reflected rays of the tags of one run.

    `reflection`: ground and polarization. `tags`: number of tags. `seed`: seed of the run.
    """

    def __init__(self, reflection: Reflection, tags: int, seed: int) -> None:
        self._ground = reflection
        rng = np.random.default_rng((seed, 5))
        self._horizontal = {
            "horizontal": np.ones(tags),
            "vertical": np.zeros(tags),
        }.get(reflection.polarization, rng.random(tags))
        self._axes = rng.normal(size=(tags, 3))
        self._axes /= np.linalg.norm(self._axes, axis=1)[:, None]
        slope, towards = math.radians(reflection.slope_deg), rng.uniform(0.0, 2.0 * np.pi, tags)
        self._upright = np.stack(
            [
                math.sin(slope) * np.sin(towards),
                math.sin(slope) * np.cos(towards),
                np.full(tags, math.cos(slope)),
            ],
            axis=1,
        )
        self._waves = rng.normal(size=(_WAVES, 2)) / reflection.uneven_length_m
        self._phases = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
        self._propagation = Propagation(ground_permittivity=reflection.permittivity)

    def gain_db(
        self, tag: int, place_m: _Floats, to_drone_m: _Floats, height_m: float
    ) -> float:
        """Level of both rays over that of the direct ray [dB].

        For a dipole, over that of the direct ray broadside of it.

        `tag`: index of the tag.
        `place_m`: the tag's place, east and north [m].
        `to_drone_m`: from the tag to the drone: east, north and up [m].
        `height_m`: height of the tag above the ground at its place [m].
        """
        slant = float(np.linalg.norm(to_drone_m))
        upright = self._upright[tag]
        height = height_m * float(upright[2])
        if self._ground.uneven_m > 0.0:
            at = place_m + to_drone_m[:2] * (height_m / (to_drone_m[2] + 2.0 * height_m))
            height = max(height + self._uneven_m(at), _LEAST_HEIGHT_M)
        towards = float(upright @ to_drone_m) / slant
        mirrored = math.sqrt(slant**2 + 4.0 * height * (towards * slant + height))
        sine = min(max((towards * slant + 2.0 * height) / mirrored, _LEAST_GRAZING), 1.0)
        phase = 2.0 * math.pi / _WAVE_M * max(mirrored - slant, 0.0)
        # Loss of amplitude on rough ground (Ament 1953, Proc. IRE 41, 142-146).
        loss = 2.0 * (2.0 * math.pi * self._ground.roughness_m * sine / _WAVE_M) ** 2
        ray = math.exp(-loss) * complex(math.cos(phase), -math.sin(phase))
        across, along = (
            ray
            * ground_reflection(
                self._propagation, math.asin(sine), FREQUENCY_HZ, horizontal=horizontal
            )
            for horizontal in (True, False)
        )
        if self._ground.polarization == "dipole":
            power = self._dipole_power(tag, to_drone_m / slant, across, along)
        else:
            share = float(self._horizontal[tag])
            power = abs(1.0 + share * across + (1.0 - share) * along) ** 2
        return 10.0 * math.log10(max(power, _LEAST_SUM**2))

    def _uneven_m(self, at_m: _Floats) -> float:
        waves = np.cos(self._waves @ at_m + self._phases)
        return self._ground.uneven_m * math.sqrt(2.0 / _WAVES) * float(waves.sum())

    def _dipole_power(self, tag: int, unit: _Floats, across: complex, along: complex) -> float:
        """Power of both polarizations together, for rays up to the drone and down."""
        east, north, up = (float(one) for one in self._axes[tag])
        flat = max(math.hypot(unit[0], unit[1]), 1e-6)
        sideways = (north * unit[0] - east * unit[1]) / flat
        ahead = (east * unit[0] + north * unit[1]) / flat
        upwards, downwards = (up * flat - sign * ahead * unit[2] for sign in (1.0, -1.0))
        return float(
            abs(sideways * (1.0 + across)) ** 2 + abs(upwards + downwards * along) ** 2
        )
