"""What a detector does with the frequency of a tag that it has found.

The four modes and their names are those of the original's configuration file
(reference/detector.md §2); there they were parsed and ignored, here they act.
"""

from enum import StrEnum

LOCK_HALF_WIDTH_HZ = 100.0
"""Half-width of the search once a frequency is locked (reference/detector.md §5)."""


class OperatingMode(StrEnum):
    """How far the search may follow a found frequency."""

    SEARCH_HARD_LOCK = "freqSearchHardLock"
    """Search the window; once confirmed keep to that frequency until `reset`."""
    SEARCH_SOFT_LOCK = "freqSearchSoftLock"
    """Search the window; go back to it when the track is lost."""
    KNOWN_HARD_LOCK = "freqKnownHardLock"
    """Search only ± 100 Hz around the tag's nominal frequency."""
    ALL_NEVER_LOCK = "freqAllNeverLock"
    """Always the whole channel; a track does not claim the tag's identity for its frequency."""
