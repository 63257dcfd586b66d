"""Modes that define how a detector uses a tag's frequency once it is found.

The names are those in the original system's configuration file, where they had no effect.
"""

from enum import StrEnum

LOCK_HALF_WIDTH_HZ = 100.0
"""Half-width of the searched band once a tag's frequency is locked [Hz]."""


class OperatingMode(StrEnum):
    """Mode that defines how the search follows a found frequency."""

    SEARCH_HARD_LOCK = "freqSearchHardLock"
    """Search the window. Once two groups are received, search only ± 100 Hz around their
    frequency until `reset`, with the lower threshold that the narrow band allows. A drift is
    followed."""
    SEARCH_SOFT_LOCK = "freqSearchSoftLock"
    """Always search the window. A tag is followed at its frequency while it is received; after
    that, anything in the window may be the tag."""
    KNOWN_HARD_LOCK = "freqKnownHardLock"
    """Always search only ± 100 Hz around the tag's nominal frequency, from the start on."""
    ALL_NEVER_LOCK = "freqAllNeverLock"
    """Always search the whole channel, without tracks: each group must reach the threshold by
    itself. Groups at any frequency are reported under the tag's id."""
