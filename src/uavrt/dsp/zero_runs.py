"""Find lost samples by the zeros that replace them."""

import numpy as np
from numpy.typing import NDArray


def zero_runs(samples: NDArray[np.complex64], shortest: int) -> list[tuple[int, int]]:
    """Find runs of at least `shortest` samples that are exactly 0.

    Noise has no long ones: samples were lost, or the radio was dead. Returns the first sample
    of each run and the one after its last.
    """
    if not (samples[shortest - 1 :: shortest] == 0).any():  # every run has one of these
        return []
    edges = np.flatnonzero(np.diff(samples == 0, prepend=False, append=False))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= shortest]
