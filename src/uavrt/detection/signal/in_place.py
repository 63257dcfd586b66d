"""Store unfiltered samples that a filter applied in place needs as neighbours."""

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.complex64]


class Surroundings:
    """Joins the samples of successive calls with their unfiltered neighbours."""

    def __init__(self) -> None:
        self._past: Samples | None = None
        """Newest samples before the filter; None: no sample was filtered."""

    def of(self, before: Samples, samples: Samples, after: Samples, reach: int) -> Samples:
        """Join new samples with `reach` unfiltered neighbours on either side.

        `before`: earlier samples, as the last call left them. `samples` (n,): those after the
        last call's. `after`: later samples. Returns shape (n + 2 reach,), zero where missing.
        """
        zeros = np.zeros(2 * reach, np.complex64)
        past = before if self._past is None else self._past
        past = np.concatenate((zeros, past))[len(past) + reach :]
        return np.concatenate((past, samples, np.concatenate((after, zeros))[:reach]))

    def filtered(self, whole: Samples, reach: int) -> None:
        """Store the unfiltered samples that the next call of `of` needs."""
        self._past = whole[-2 * reach : -reach].copy()

    def unfiltered(self) -> None:
        """Record that the samples of this call stay unfiltered."""
        self._past = None
