"""Compare the noise at each pulse with that usual at the time."""

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.tuning import FLIGHT


def over_usual_noise_db(
    noise_db: NDArray[np.float64], time_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) noise over its median of the time around [dB].

    Noise from one direction remains. A change of the receiver's gain, which changes noise and
    pulses alike, does not.
    """
    over_db = noise_db.copy()
    parts = np.floor(time_s / FLIGHT.noise_step_s)
    for part in np.unique(parts).tolist():
        middle_s = (part + 0.5) * FLIGHT.noise_step_s
        around = np.abs(time_s - middle_s) <= FLIGHT.noise_reach_s
        over_db[parts == part] -= np.median(noise_db[around])
    return over_db
