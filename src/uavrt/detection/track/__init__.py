"""From candidates to reported pulses: judge, track, assign to a tag, report.

`judging` accepts or rejects a candidate group; `tracks` and `following` track it. `bursts`,
`chance` and `coincidence` compute the odds of a chance match; `ghosts`, `senders`, `trains`
and `assignment` decide which tag sent it; `reporting` makes the records.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.detection.track.bursts import LEAST_POWER, Bursts, Known
    from uavrt.detection.track.chance import OnAir
    from uavrt.detection.track.following import Follower
    from uavrt.detection.track.ghosts import mark_ghosts
    from uavrt.detection.track.judging import Judge, share_a_pulse
    from uavrt.detection.track.reporting import Reporter
    from uavrt.detection.track.senders import Senders, part, small_ratio
    from uavrt.detection.track.tracks import (
        CLOCK_ERROR,
        MOST_TOLD_BY_ONE,
        WEAKEST_POWER,
        Track,
        least_real,
    )
    from uavrt.detection.track.unlocked import forget_old, joined

__all__ = [
    "CLOCK_ERROR",
    "LEAST_POWER",
    "MOST_TOLD_BY_ONE",
    "WEAKEST_POWER",
    "Bursts",
    "Follower",
    "Judge",
    "Known",
    "OnAir",
    "Reporter",
    "Senders",
    "Track",
    "forget_old",
    "joined",
    "least_real",
    "mark_ghosts",
    "part",
    "share_a_pulse",
    "small_ratio",
]
__getattr__ = lazily(
    __name__,
    {
        "Bursts": "bursts",
        "CLOCK_ERROR": "tracks",
        "Follower": "following",
        "Judge": "judging",
        "Known": "bursts",
        "LEAST_POWER": "bursts",
        "MOST_TOLD_BY_ONE": "tracks",
        "OnAir": "chance",
        "Reporter": "reporting",
        "Senders": "senders",
        "Track": "tracks",
        "WEAKEST_POWER": "tracks",
        "forget_old": "unlocked",
        "joined": "unlocked",
        "least_real": "tracks",
        "mark_ghosts": "ghosts",
        "part": "senders",
        "share_a_pulse": "judging",
        "small_ratio": "senders",
    },
)
