"""Compare the noise at each pulse with that usual at the receiver's gain of the time."""

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.tuning import FLIGHT

_Floats = NDArray[np.float64]


def over_usual_noise_db(noise_db: _Floats, snr_db: _Floats) -> _Floats:
    """(n,) noise at pulses in order of time, over its median at that gain [dB].

    Noise from one direction remains, and noise that begins or ends in a moment.
    """
    over_db = noise_db.copy()
    for part in np.split(np.arange(len(noise_db)), _gain_changes(noise_db, snr_db)):
        over_db[part] -= np.median(noise_db[part])
    return over_db


def _gain_changes(noise_db: _Floats, snr_db: _Floats) -> list[int]:
    """Numbers of the first pulses after a change of the receiver's gain.

    It raises noise and pulses alike between two pulses. Other noise that begins lowers the SNR;
    noise from one direction grows over several pulses.
    """
    side = FLIGHT.gain_pulses
    if len(noise_db) < 2 * side:
        return []
    noise, snr = (np.lib.stride_tricks.sliding_window_view(x, side) for x in (noise_db, snr_db))
    steady = np.ptp(noise, axis=1) < FLIGHT.steady_noise_db
    steps, falls = (np.median(x, axis=1) for x in (noise, snr))
    steps, falls = steps[side:] - steps[:-side], falls[side:] - falls[:-side]
    found = steady[side:] & steady[:-side] & (np.abs(steps) >= FLIGHT.gain_step_db)
    found &= np.abs(falls) < 0.5 * np.abs(steps)
    return (np.flatnonzero(found) + side).tolist()
