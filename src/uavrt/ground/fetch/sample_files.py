"""Which files of a flight are samples: they are large, and come only when asked for."""

from typing import Literal

SampleKind = Literal["channels", "band"]
CHANNELS: SampleKind = "channels"
"""The kept channels of the tags: 15 kB a second each."""
BAND: SampleKind = "band"
"""The recorded band and captures: 1.5 MB a second and more, which no radio link brings."""


def sample_part(path: str) -> SampleKind | None:
    """Find which samples a file on the drone holds; None for all other files."""
    if "/iq/channels/" in path:
        return CHANNELS
    return BAND if "/iq/" in path else None


def is_samples(path: str) -> bool:
    """Whether a file on the drone holds samples."""
    return sample_part(path) is not None
