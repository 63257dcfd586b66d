"""Recognise sample files of a flight, which are large and downloaded only on request."""

from typing import Literal

SampleKind = Literal["channels", "band"]
CHANNELS: SampleKind = "channels"
"""Name of the sample files with recorded channels of single tags, 15 kB/s each."""
BAND: SampleKind = "band"
"""Name of sample files with the full band or a raw capture, too large for a radio link."""


def sample_part(path: str) -> SampleKind | None:
    """Return the kind of samples in a file on the drone; None for a file without samples."""
    if "/iq/channels/" in path:
        return CHANNELS
    return BAND if "/iq/" in path else None


def is_samples(path: str) -> bool:
    """True if a file on the drone holds samples."""
    return sample_part(path) is not None
