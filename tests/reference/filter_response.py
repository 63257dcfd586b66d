"""Magnitude response of a filter, evaluated directly."""

import numpy as np
from numpy.typing import NDArray


def response_db(
    taps: NDArray[np.float64], frequencies_hz: NDArray[np.float64], sample_rate_hz: float
) -> NDArray[np.float64]:
    """Magnitude response of a filter, evaluated directly.

    `frequencies_hz` (m,): frequencies [Hz].
    `sample_rate_hz`: rate at which the taps run [Hz].
    Returns: 20 log10 of the magnitude, at least -400 [dB].
    `taps`: shape (n,).
    """
    turns = np.outer(frequencies_hz / sample_rate_hz, np.arange(taps.size))
    magnitude = np.abs(np.exp(-2j * np.pi * turns) @ taps)
    return np.asarray(20.0 * np.log10(np.maximum(magnitude, 1e-20)), dtype=np.float64)
