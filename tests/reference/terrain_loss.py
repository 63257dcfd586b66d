"""Loss over one profile of the ground, point by point: what the kernels are compared with."""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.localization.terrain.diffraction import EARTH_M, beyond_level_db, edge_parameters

_Floats = NDArray[np.floating]


def terrain_loss_db(
    distance_m: _Floats,
    height_m: _Floats,
    *,
    antenna_m: float,
    tag_m: float,
    frequency_hz: float,
) -> float:
    """Loss [dB] of one profile beyond that of level ground.

    `distance_m` (n,): from the drone, 0 at the first point and rising; the tag is at the last.
    `height_m`: of the ground, of any datum.
    `antenna_m`, `tag_m`: heights above the ground at either end.
    """
    wavelength = SPEED_OF_LIGHT_M_S / frequency_hz
    x = np.asarray(distance_m, np.float64)
    ground = np.asarray(height_m, np.float64) - x * x / (2.0 * EARTH_M)
    nu = edge_parameters(
        x[np.newaxis, 1:-1],
        ground[np.newaxis, 1:-1],
        x[-1:],
        np.asarray(ground[:1] + antenna_m),
        ground[-1:] + tag_m,
        wavelength,
    )
    return float(
        beyond_level_db(nu, x[-1:], antenna_m=antenna_m, tag_m=tag_m, wavelength_m=wavelength)[
            0
        ]
    )
