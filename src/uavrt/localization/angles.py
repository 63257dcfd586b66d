"""Compute differences and gaps of angles on the circle, for whole arrays."""

from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray


@overload
def difference_deg(first: float, second: float) -> float: ...
@overload
def difference_deg(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]: ...
def difference_deg(first: ArrayLike, second: ArrayLike) -> float | NDArray[np.float64]:
    """Signed angle from `second` to `first` [deg], in [-180, 180)."""
    turned = np.asarray(first, np.float64) - np.asarray(second, np.float64)
    wrapped = np.remainder(turned + 180.0, 360.0) - 180.0
    return float(wrapped) if wrapped.ndim == 0 else np.asarray(wrapped)


def widest_gap_deg(angles_deg: NDArray[np.float64]) -> float:
    """Width of the widest arc that contains none of the angles [deg]; 360 for fewer than two
    angles.
    """
    if len(angles_deg) < 2:
        return 360.0
    ordered = np.sort(np.remainder(angles_deg, 360.0))
    return float(np.max(np.diff(ordered, append=ordered[0] + 360.0)))
