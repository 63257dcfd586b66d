"""Antenna patterns: gain relative to boresight, by direction in the antenna's frame.

A pattern is a table of decibels from 0° to 180° off boresight, mirrored to the other side. The
tables of Telonics antennas are read from the maker's plots (±1.5 dB). Those of the Adelaide H
antenna are measured in one plane and theoretical in the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.core.errors import NotFound, UsageError
from uavrt.core.plugins import Registry

MONOPOLE = "monopole"
"""Name of the upright whip antenna, whose gain is equal at all headings."""
NULL_DB = -30.0
"""Gain in the deepest null of an installed antenna [dB]; reflections by the airframe prevent
deeper nulls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaPattern:
    """Table of an antenna's gain relative to boresight, by angle off boresight."""

    name: str
    e_plane_db: tuple[float, ...]
    """Gain at equal steps from 0° to 180° off boresight [dB], in the plane of the antenna's
    elements, which is horizontal on a level drone."""
    h_plane_db: tuple[float, ...] | None = None
    """Gain at the same angles in the plane across the elements [dB]; None if equal to
    `e_plane_db`."""

    def __post_init__(self) -> None:
        for table in (self.e_plane_db, self.h_plane_db):
            if table is not None and (len(table) < 2 or not np.all(np.isfinite(table))):
                raise UsageError(
                    f"the pattern of antenna {self.name} must contain at least two finite "
                    "values",
                    remedy="Give decibels at equal steps from 0° to 180°",
                )

    def gain_db(self, off_boresight_deg: ArrayLike) -> NDArray[np.float64]:
        """Gain relative to boresight in the plane of the elements [dB], for any angles off
        boresight.
        """
        return _looked_up(self.e_plane_db, off_boresight_deg)

    def gain_towards_db(
        self,
        forward: NDArray[np.float64],
        right: NDArray[np.float64],
        down: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Gain relative to boresight in directions given as unit vectors from antenna to source
        [dB].

        Between the planes along and across the elements, decibels are averaged by cos² of the
        angle about the boresight, the usual interpolation. `forward`, `right` and `down` are
        the vectors' components along the antenna's axes, arrays of one shape.
        """
        off = np.degrees(np.arccos(np.clip(forward, -1.0, 1.0)))
        e_plane = _between(self.e_plane_db, off)
        if self.h_plane_db is None:
            return e_plane
        across = right**2 + down**2
        share = np.divide(right**2, across, out=np.ones_like(across), where=across > 1e-12)
        return share * e_plane + (1.0 - share) * _between(self.h_plane_db, off)


def _looked_up(table_db: Sequence[float], angle_deg: ArrayLike) -> NDArray[np.float64]:
    turned = np.asarray(angle_deg, np.float64) + 180.0
    return _between(table_db, np.abs(np.remainder(turned, 360.0) - 180.0))


def _between(table_db: Sequence[float], angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    table = np.asarray(table_db, np.float64)
    place = angle_deg * ((len(table) - 1) / 180.0)
    below = np.minimum(place.astype(np.intp), len(table) - 2)
    part = place - below
    return np.asarray(table[below] * (1.0 - part) + table[below + 1] * part)


def _theory_h_plane(steps: int) -> tuple[float, ...]:
    """Return the H antenna's theoretical pattern across its elements, "0 to -8.75 dB smoothly"
    (thesis §1.5).

    Two half-wave elements, each omnidirectional in this plane, give a figure similar to a
    cardioid, (1 + c cos θ) / (1 + c); c = 0.4650 gives -8.75 dB at 180°.
    """
    ratio = 10.0 ** (-8.75 / 20.0)
    c = (1.0 - ratio) / (1.0 + ratio)
    angles = np.linspace(0.0, np.pi, steps)
    levels = 20.0 * np.log10((1.0 + c * np.cos(angles)) / (1.0 + c))
    return tuple(float(level) for level in levels)


_OWN = {
    pattern.name: pattern
    for pattern in (
        AntennaPattern(
            name="RA-2A",
            e_plane_db=(
                *(0, 0, -0.5, -1, -2.5, -5, -10.5, -14.5, -20.5, -27.5),
                *(-20, -17.5, -14.5, -12.5, -13.5, -10.5, -10.5, -10, -10),
            ),
        ),
        AntennaPattern(
            name="RA-23K",
            e_plane_db=(
                *(0, -0.5, -1, -2, -3, -5, -8, -10.5, -16, -18),
                *(-17.5, -16, -14, -13.5, -11.5, -10.5, -10, -9.5, -10),
            ),
        ),
        AntennaPattern(
            name="H3",  # H_antenna3, measured
            e_plane_db=(
                *(-0.5, -0.5, -1.4, -2.2, -4.1, -6.6, -11.3, -16.4, -24.8, -35),
                *(-35, -30, -31, -31, -23, -16.6, -14.8, -12.5, -10.9),
            ),
        ),
        AntennaPattern(
            name="H",  # H_antenna, theory; the null is held at NULL_DB
            e_plane_db=(
                *(0, -0.24, -0.97, -2.2, -3.95, -6.3, -9.3, -13.6, -20.4, NULL_DB),
                *(-22, -16.8, -14, -12.3, -11, -10, -9.3, -8.9, -8.75),
            ),
            h_plane_db=_theory_h_plane(19),
        ),
        AntennaPattern(
            name="yagi-2",  # TrackerBots' folded Yagi, nearly a figure of eight (§1.5)
            e_plane_db=(
                *(0, -0.4, -1.6, -3.8, -7.3, -13.4, NULL_DB),
                *(-14.72, -8.62, -5.12, -2.92, -1.72, -1.32),
            ),
            h_plane_db=tuple(float(level) for level in np.linspace(0.0, -1.32, 13)),
        ),
        AntennaPattern(name="isotropic", e_plane_db=(0.0, 0.0)),
        AntennaPattern(name="monopole", e_plane_db=(0.0, 0.0)),  # upright; see monopole_gain_db
    )
}
PATTERNS = Registry("uavrt.antennas", _OWN, AntennaPattern)
"""Antenna patterns by name, including those that installed packages add
(docs/how-to/extend.md)."""


def monopole_gain_db(elevation_deg: ArrayLike) -> NDArray[np.float64]:
    """Gain of an upright monopole relative to that towards the horizon [dB], at least -30
    dB.
    """
    cosine = np.abs(np.cos(np.radians(np.asarray(elevation_deg, np.float64))))
    return np.maximum(20.0 * np.log10(np.maximum(cosine, 1e-9)), NULL_DB)


def pattern_named(antenna: AntennaPattern | str) -> AntennaPattern:
    """Return the pattern with a given name; a pattern is returned unchanged. Raises
    `UsageError` for an unknown name.
    """
    if isinstance(antenna, AntennaPattern):
        return antenna
    if antenna not in PATTERNS:
        raise NotFound(
            f"there is no antenna {antenna!r}", remedy=f"Choose from {', '.join(PATTERNS)}"
        )
    return PATTERNS[antenna]
