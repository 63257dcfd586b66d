"""How a detector uses a tag's frequency once found.

The four modes and their names are those of the original's configuration file; there they were
parsed and ignored, here they are implemented.
"""

from enum import StrEnum

LOCK_HALF_WIDTH_HZ = 100.0
"""Half-width of the search once a frequency is locked."""


class OperatingMode(StrEnum):
    """How far the search may follow a found frequency."""

    SEARCH_HARD_LOCK = "freqSearchHardLock"
    """Search the window; once two groups are heard search ± 100 Hz around their frequency only,
    with the lower threshold that this allows, until `reset`. A drift is followed."""
    SEARCH_SOFT_LOCK = "freqSearchSoftLock"
    """Search the window always; a tag is followed at its frequency as long as it is heard, and
    afterwards anything in the window may be the tag."""
    KNOWN_HARD_LOCK = "freqKnownHardLock"
    """Search only ± 100 Hz around the tag's nominal frequency, from the start and always."""
    ALL_NEVER_LOCK = "freqAllNeverLock"
    """The whole channel always, and no track: each group reaches the search's threshold by
    itself. Groups of all frequencies are reported under the tag's number."""
