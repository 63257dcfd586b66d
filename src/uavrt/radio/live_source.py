"""What all live sources have in common: rate, frequency, and the numbering of samples."""

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import FormatError
from uavrt.messages import IQBlock
from uavrt.radio.times import NominalTimes, TimeKeeper


def check_rates(sample_rate_hz: float, center_frequency_hz: float) -> None:
    """Refuse rates and frequencies that cannot be meant.

    Raises
    ------
    FormatError
        Not positive, or not a number.
    """
    if not 0.0 < sample_rate_hz < 1e9:
        raise FormatError(
            f"sample rate {sample_rate_hz} Hz is not possible",
            remedy="Give --sample-rate in samples per second, e.g. 3000000",
        )
    if not 0.0 <= center_frequency_hz < 1e12:
        raise FormatError(
            f"center frequency {center_frequency_hz} Hz is not possible",
            remedy="Give --center-frequency in hertz, e.g. 148.7e6",
        )


class LiveSource:
    """Base of sources that have no length.

    Parameters
    ----------
    sample_rate_hz, center_frequency_hz : float
        What the sender was told.

    Raises
    ------
    FormatError
        A rate that is not possible.
    """

    def __init__(self, sample_rate_hz: float, center_frequency_hz: float) -> None:
        check_rates(sample_rate_hz, center_frequency_hz)
        self.samples_lost = 0
        self._rate_hz = sample_rate_hz
        self._center_hz = center_frequency_hz
        self._index = 0
        """Of the next sample, lost ones counted."""

    @property
    def sample_rate_hz(self) -> float:
        """Nominal sample rate [Hz]."""
        return self._rate_hz

    @property
    def center_frequency_hz(self) -> float:
        """Radio frequency at the middle of what is received [Hz]."""
        return self._center_hz

    @property
    def total_samples(self) -> int | None:
        """None: nobody knows how long a live stream will be."""
        return None

    def _next(
        self, samples: NDArray[np.complex64], times: TimeKeeper | NominalTimes, lost: int
    ) -> IQBlock:
        """Make the block that begins at the present index, and go on behind it."""
        index = self._index
        self._index += len(samples)
        return IQBlock(
            samples=samples,
            sample_index=index,
            time_ns=times.time_ns(index),
            sample_rate_hz=times.sample_rate_hz,
            lost_before=lost,
        )
