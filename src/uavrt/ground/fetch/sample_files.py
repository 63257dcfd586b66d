"""Recognise the sample files of a flight: they are large and are fetched only on request."""

from typing import Literal

SampleKind = Literal["channels", "band"]
CHANNELS: SampleKind = "channels"
"""Kind of sample file: recorded channels of single tags, 15 kB/s each."""
BAND: SampleKind = "band"
"""Kind of sample file: full band or raw capture, from 1.5 MB/s, too much for a radio link."""


def sample_part(path: str) -> SampleKind | None:
    """Kind of samples that a file on the drone holds; None for a file without samples."""
    if "/iq/channels/" in path:
        return CHANNELS
    return BAND if "/iq/" in path else None


def is_samples(path: str) -> bool:
    """True if a file on the drone holds samples."""
    return sample_part(path) is not None
