"""Unfiltered neighbours of samples that a filter replaces step by step."""

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.complex64]


class Surroundings:
    """Gives the samples of one call after the other with their unfiltered neighbours."""

    def __init__(self) -> None:
        self._past: Samples | None = None
        """The newest samples as they were before the filter; None: nothing was filtered."""

    def of(self, before: Samples, samples: Samples, after: Samples, reach: int) -> Samples:
        """Put `reach` neighbours to either side of new samples.

        `before`: samples before them, in whatever state the last call left them.
        `samples` (n,): that follow those of the last call.
        `after`: samples after them; what is not there counts as zero.
        Returns: shape (n + 2 reach,).
        """
        zeros = np.zeros(2 * reach, np.complex64)
        past = before if self._past is None else self._past
        past = np.concatenate((zeros, past))[len(past) + reach :]
        return np.concatenate((past, samples, np.concatenate((after, zeros))[:reach]))

    def filtered(self, whole: Samples, reach: int) -> None:
        """Keep what the next call needs of samples that are replaced now."""
        self._past = whole[-2 * reach : -reach].copy()

    def unfiltered(self) -> None:
        """Note that the samples stay as they are."""
        self._past = None
