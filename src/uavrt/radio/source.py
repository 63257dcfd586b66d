"""Interface of all sources of samples: real, replayed or simulated.

Code that processes samples works with any of these sources without change.
"""

from typing import Protocol

from uavrt.core.messages import IQBlock


class SampleSource(Protocol):
    """A stream of complex samples with times."""

    @property
    def sample_rate_hz(self) -> float:
        """Nominal sample rate [Hz]."""
        ...

    @property
    def center_frequency_hz(self) -> float:
        """Radio frequency at the middle of the band [Hz]."""
        ...

    @property
    def total_samples(self) -> int | None:
        """Length of the recording [samples], or None for a live stream."""
        ...

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block, or None if none is ready within `timeout_s`.

        The block's samples stay valid until the next call. Raises `EOFError` at the end of a
        recording, `RadioError` if the radio failed and must be reopened, `FormatError` if the
        data have another format.
        """
        ...

    def close(self) -> None:
        """Stop the radio's program or close the file; repeated calls have no effect."""
        ...
