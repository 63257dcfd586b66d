"""Store unfiltered samples for filters that overwrite samples but need those around them."""

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.complex64]


class Surroundings:
    """Extends each block of samples by the unfiltered samples before and after it."""

    def __init__(self) -> None:
        self._past: Samples | None = None
        """Newest samples before they were filtered; None: the filter has not changed them."""

    def of(self, before: Samples, samples: Samples, after: Samples, reach: int) -> Samples:
        """Extend new samples by `reach` unfiltered samples on each side, (n + 2 reach,)."""
        zeros = np.zeros(2 * reach, np.complex64)
        past = before if self._past is None else self._past
        past = np.concatenate((zeros, past))[len(past) + reach :]
        return np.concatenate((past, samples, np.concatenate((after, zeros))[:reach]))

    def filtered(self, whole: Samples, reach: int) -> None:
        """Store the end of `whole`, the unfiltered samples, for the next call of `of`."""
        self._past = whole[-2 * reach : -reach].copy()

    def unfiltered(self) -> None:
        """Record that the filter does not change the samples of this call."""
        self._past = None
