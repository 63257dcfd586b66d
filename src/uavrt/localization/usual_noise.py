"""Compute the noise at each pulse relative to the usual noise at the receiver's gain at that
time.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.tuning import FLIGHT

_Floats = NDArray[np.float64]


def over_usual_noise_db(noise_db: _Floats, snr_db: _Floats) -> _Floats:
    """Noise at pulses in order of time, relative to its median at the same receiver gain [dB],
    shape (n,).

    Only the effect of the gain is removed: noise from a direction and sudden noise remain.
    """
    over_db = noise_db.copy()
    for part in np.split(np.arange(len(noise_db)), _gain_changes(noise_db, snr_db)):
        over_db[part] -= np.median(noise_db[part])
    return over_db


def _gain_changes(noise_db: _Floats, snr_db: _Floats) -> list[int]:
    """Indices of the first pulses after a change of the receiver's gain.

    Such a change shifts noise and pulses equally between two pulses. Noise that begins
    otherwise lowers the SNR, and noise from a direction grows over several pulses.
    """
    side = FLIGHT.gain_pulses
    if len(noise_db) < 2 * side:
        return []
    noise, snr = (np.lib.stride_tricks.sliding_window_view(x, side) for x in (noise_db, snr_db))
    steady = np.ptp(noise, axis=1) < FLIGHT.gain_step_db
    steps, falls = (np.median(x, axis=1) for x in (noise, snr))
    steps, falls = steps[side:] - steps[:-side], falls[side:] - falls[:-side]
    found = steady[side:] & steady[:-side] & (np.abs(steps) >= FLIGHT.gain_step_db)
    found &= np.abs(falls) < 0.5 * np.abs(steps)
    return (np.flatnonzero(found) + side).tolist()
