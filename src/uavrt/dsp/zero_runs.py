"""Zeros in place of samples that did not come."""

import numpy as np
from numpy.typing import NDArray


def zero_runs(samples: NDArray[np.complex64], shortest: int) -> list[tuple[int, int]]:
    """Find the runs of at least `shortest` samples that are exactly 0.

    No noise is so for long: lost samples were filled in, or the radio was dead. Shorter runs
    may be samples of few bits.

    Returns
    -------
    list of (int, int)
        First sample and the one after the last, in order of time.
    """
    if not (samples[shortest - 1 :: shortest] == 0).any():  # every run has one of these
        return []
    edges = np.flatnonzero(np.diff(samples == 0, prepend=False, append=False))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= shortest]
