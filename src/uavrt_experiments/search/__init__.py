"""Planners against each other: published tables, paired seeds, bars."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.search.campaign import fly_all, plan
    from uavrt_experiments.search.catalogue import SCENARIOS
    from uavrt_experiments.search.pictures import draw
    from uavrt_experiments.search.table import Flown, honesty, results, section
    from uavrt_experiments.search.terrain import PLANE, Hills, elevation_of

__all__ = [
    "PLANE",
    "SCENARIOS",
    "Flown",
    "Hills",
    "draw",
    "elevation_of",
    "fly_all",
    "honesty",
    "plan",
    "results",
    "section",
]
__getattr__ = lazily(
    __name__,
    {
        "Flown": "table",
        "Hills": "terrain",
        "PLANE": "terrain",
        "SCENARIOS": "catalogue",
        "draw": "pictures",
        "elevation_of": "terrain",
        "fly_all": "campaign",
        "honesty": "table",
        "plan": "campaign",
        "results": "table",
        "section": "table",
    },
)
