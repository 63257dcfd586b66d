"""Find everything that beeps, without knowing any tag.

`points` finds strong pulses anywhere in a band; `trains` sorts them by sender, with the
intervals of `beats` and `chains`; `naming` compares the trains with the listed tags.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.detection.beeps.beats import FEWEST, FoundBeat, find_beats
    from uavrt.detection.beeps.interval_fit import Beat, fit_beat
    from uavrt.detection.beeps.naming import name_trains, shared_offset_ppm
    from uavrt.detection.beeps.points import Points, PointSearch
    from uavrt.detection.beeps.search import BeepSearch, words_of_beeps
    from uavrt.detection.beeps.trains import (
        BURST_S,
        FEWEST_BURSTS,
        Train,
        find_trains,
        split_bursts,
    )

__all__ = [
    "BURST_S",
    "FEWEST",
    "FEWEST_BURSTS",
    "Beat",
    "BeepSearch",
    "FoundBeat",
    "PointSearch",
    "Points",
    "Train",
    "find_beats",
    "find_trains",
    "fit_beat",
    "name_trains",
    "shared_offset_ppm",
    "split_bursts",
    "words_of_beeps",
]
__getattr__ = lazily(
    __name__,
    {
        "BURST_S": "trains",
        "Beat": "interval_fit",
        "BeepSearch": "search",
        "FEWEST": "beats",
        "FEWEST_BURSTS": "trains",
        "FoundBeat": "beats",
        "name_trains": "naming",
        "shared_offset_ppm": "naming",
        "PointSearch": "points",
        "Points": "points",
        "Train": "trains",
        "find_beats": "beats",
        "find_trains": "trains",
        "fit_beat": "interval_fit",
        "split_bursts": "trains",
        "words_of_beeps": "search",
    },
)
