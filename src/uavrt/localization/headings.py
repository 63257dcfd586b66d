"""Compute the directions of the antenna's axes for many attitudes at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.core.errors import UsageError
from uavrt.localization.antenna import AntennaPattern


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Headings:
    """Directions of the antenna at each pulse."""

    yaw_deg: NDArray[np.float64]
    """Direction of the boresight over ground at each pulse, clockwise from true north [deg],
    shape (n,)."""
    axes: NDArray[np.float64] | None = None
    """The antenna's forward, right and down axes in north, east, down, shape (n, 3, 3); None
    for a level antenna."""

    @classmethod
    def level(cls, yaw_deg: ArrayLike) -> "Headings":
        """Headings of a level antenna."""
        return cls(yaw_deg=np.atleast_1d(np.asarray(yaw_deg, np.float64)))

    @classmethod
    def from_quaternions(cls, quaternion_wxyz: ArrayLike) -> "Headings":
        """Compute headings and antenna axes from attitudes.

        `quaternion_wxyz` (n, 4) rotates from the antenna frame (forward, right, down) to
        north-east-down; it may have any length except zero.
        """
        q = np.atleast_2d(np.asarray(quaternion_wxyz, np.float64))
        length = np.linalg.norm(q, axis=1, keepdims=True)
        if q.shape[1] != 4 or not np.all(length > 1e-6):
            raise UsageError(
                "an attitude is not a valid quaternion",
                remedy="Leave out the pulses without a pose",
            )
        q = q / length
        w, x, y, z = q.T
        forward = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
        right = (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x))
        down = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
        axes = np.stack([np.stack(axis, axis=1) for axis in (forward, right, down)], axis=1)
        return cls(yaw_deg=yaws_deg(q), axes=axes)

    def gain_db(
        self, pattern: AntennaPattern, bearing_deg: NDArray[np.float64], elevation_deg: float
    ) -> NDArray[np.float64]:
        """Gain relative to boresight [dB], shape (n, b), towards bearings (b,) at one elevation
        [deg].
        """
        if self.axes is None and elevation_deg == 0.0:
            return pattern.gain_db(bearing_deg[None, :] - self.yaw_deg[:, None])
        bearing, elevation = np.radians(bearing_deg), np.radians(elevation_deg)
        horizontal = np.cos(elevation)
        towards = np.stack(
            [
                horizontal * np.cos(bearing),
                horizontal * np.sin(bearing),
                np.full_like(bearing, -np.sin(elevation)),
            ]
        )
        axes = self.axes if self.axes is not None else _level_axes(self.yaw_deg)
        forward, right, down = (axes[:, which, :] @ towards for which in range(3))
        return pattern.gain_towards_db(forward, right, down)


def yaws_deg(quaternion_wxyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Headings (n,) of unit quaternions (n, 4), clockwise from north [deg]; NaN for quaternions
    with NaN.
    """
    w, x, y, z = quaternion_wxyz.T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.asarray(np.remainder(np.degrees(yaw), 360.0))


def _level_axes(yaw_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    cosine, sine = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    zero, one = np.zeros_like(cosine), np.ones_like(cosine)
    rows = ((cosine, sine, zero), (-sine, cosine, zero), (zero, zero, one))
    return np.stack([np.stack(row, axis=1) for row in rows], axis=1)
