"""Antenna patterns: gain of an antenna in each direction.

The tables of the Telonics RA-2A and RA-23K contain the gain relative to boresight [dB] from 0°
to 180° in steps of 10°. They were read from the maker's plots (±1.5 dB).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.antenna_switch import AntennaSwitch
from uavrt.simulation.scene.record import ScenarioRecord

PATTERNS_DB: dict[str, tuple[float, ...]] = {
    "RA-2A": (
        *(0, 0, -0.5, -1, -2.5, -5, -10.5, -14.5, -20.5, -27.5),
        *(-20, -17.5, -14.5, -12.5, -13.5, -10.5, -10.5, -10, -10),
    ),
    "RA-23K": (
        *(0, -0.5, -1, -2, -3, -5, -8, -10.5, -16, -18),
        *(-17.5, -16, -14, -13.5, -11.5, -10.5, -10, -9.5, -10),
    ),
}
_NULL_DB = -30.0
"""Depth of the pattern's nulls relative to its maximum [dB]; waves that the airframe scatters
limit the depth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Antenna(ScenarioRecord):
    """Antenna of the simulated drone and its mounting."""

    pattern: Literal["RA-2A", "RA-23K", "isotropic", "monopole", "table"] = "RA-23K"
    table_db: tuple[float, ...] = ()
    """Pattern relative to boresight [dB], at equal steps from 0° to 180°, both included."""
    gain_dbi: Annotated[float, Ge(-20), Le(30)] = 4.0
    """Gain at boresight [dBi]; for a monopole, at the horizon."""
    polarization: Literal["horizontal", "vertical", "any"] = "horizontal"
    """Polarization of the antenna on a level drone; "any" receives every polarization without
    loss."""
    cross_polarization_db: Annotated[float, Ge(-40), Le(0)] = -15.0
    """Level of a received wave with perpendicular polarization [dB]; scattering limits how much
    it is suppressed."""
    yaw_offset_deg: float = 0.0
    """Angle of the boresight clockwise from the drone's nose [°]."""
    pitch_offset_deg: float = 0.0
    roll_offset_deg: float = 0.0
    offset_forward_m: float = 0.0
    """Position of the antenna in the drone's frame: distance ahead of the autopilot [m]."""
    offset_right_m: float = 0.0
    offset_down_m: float = 0.0
    switch: AntennaSwitch | None = None
    """Switch that connects the receiver to several antennas of this pattern in turn; None: a
    single antenna."""


def off_boresight_deg(direction_body: geometry.Vector) -> float:
    """Angle between boresight (forward) and a unit direction in the antenna's frame [°]."""
    return math.degrees(math.acos(max(-1.0, min(1.0, direction_body[0]))))


def pattern_db(antenna: Antenna, direction_body: geometry.Vector) -> float:
    """Gain in a unit direction of the antenna's frame (FRD), relative to its maximum [dB].

    Directional patterns are symmetric about the boresight. Their tables are cuts in azimuth,
    but at low elevation the angle from boresight determines the gain. A monopole has a gain of
    20 log10(cos elevation) about its down axis, which tilts with the drone.
    """
    if antenna.pattern == "isotropic":
        return 0.0
    if antenna.pattern == "monopole":
        horizontal = math.hypot(direction_body[0], direction_body[1])
        return max(_NULL_DB, 20.0 * math.log10(max(horizontal, 1e-6)))
    table = antenna.table_db if antenna.pattern == "table" else PATTERNS_DB[antenna.pattern]
    angles = np.linspace(0.0, 180.0, len(table))
    return float(np.interp(off_boresight_deg(direction_body), angles, table))


def transverse_axes(
    direction: geometry.Vector, down: geometry.Vector
) -> tuple[geometry.Vector, geometry.Vector]:
    """Two unit vectors perpendicular to a ray, one horizontal and one upright.

    `down`: direction of the down axis.
    """
    horizontal = geometry.cross(down, direction)
    if geometry.length(horizontal) < 1e-9:
        horizontal = geometry.cross((1.0, 0.0, 0.0), direction)
    horizontal = geometry.scale(horizontal, 1.0 / geometry.length(horizontal))
    return horizontal, geometry.cross(direction, horizontal)


def polarization_db(
    antenna: Antenna, direction_body: geometry.Vector, field_body: geometry.Vector
) -> float:
    """Level change [dB, ≤ 0] from the angle between the electric fields of wave and antenna."""
    if antenna.polarization == "any":
        return 0.0
    horizontal, upright = transverse_axes(direction_body, (0.0, 0.0, 1.0))
    own = horizontal if antenna.polarization == "horizontal" else upright
    match = geometry.dot(own, field_body) ** 2
    floor = 10.0 ** (antenna.cross_polarization_db / 10.0)
    return 10.0 * math.log10(floor + (1.0 - floor) * match)
