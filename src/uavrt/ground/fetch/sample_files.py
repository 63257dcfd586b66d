"""Recognise the sample files of a flight: they are large and are fetched only on request."""

from typing import Literal

SampleKind = Literal["channels", "band"]
CHANNELS: SampleKind = "channels"
"""Recorded channels of the tags: 15 kB a second each."""
BAND: SampleKind = "band"
"""Recorded full band and captures: 1.5 MB/s and more, too much for any radio link."""


def sample_part(path: str) -> SampleKind | None:
    """Find which samples a file on the drone holds; None for all other files."""
    if "/iq/channels/" in path:
        return CHANNELS
    return BAND if "/iq/" in path else None


def is_samples(path: str) -> bool:
    """Whether a file on the drone holds samples."""
    return sample_part(path) is not None
