"""Find lost samples, which appear as runs of zeros."""

import numpy as np
from numpy.typing import NDArray


def zero_runs(samples: NDArray[np.complex64], shortest: int) -> list[tuple[int, int]]:
    """Find runs of at least `shortest` samples that are exactly 0; return the first index and
    the index after the last of each run.

    Noise contains no long runs of zeros, so samples were lost or the radio delivered
    nothing.
    """
    if not (samples[shortest - 1 :: shortest] == 0).any():  # every run has one of these
        return []
    edges = np.flatnonzero(np.diff(samples == 0, prepend=False, append=False))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= shortest]
