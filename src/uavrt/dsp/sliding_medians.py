"""Compute the median over time of each frequency row of a spectrogram, several times faster
than NumPy.
"""

import numpy as np
from numpy.typing import NDArray


def medians(power: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the median of each column, equal to `np.median(power, axis=0)`.

    It is faster because it sorts contiguous copies around one element; `np.median` sorts
    strided data around two.
    """
    lines = power.T.copy()
    count = lines.shape[1]
    half = count // 2
    lines.partition(half, axis=1)
    upper: NDArray[np.float32] = lines[:, half]
    if count % 2:
        return upper
    lower: NDArray[np.float32] = lines[:, :half].max(axis=1)
    return np.asarray((lower + upper) * np.float32(0.5), np.float32)
