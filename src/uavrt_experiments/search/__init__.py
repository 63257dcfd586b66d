"""Planners against each other: published tables, paired seeds, bars."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.search.campaign import fly_all, plan
    from uavrt_experiments.search.catalogue import SCENARIOS
    from uavrt_experiments.search.page import page_section, put_section
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
    "page_section",
    "plan",
    "put_section",
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
        "page_section": "page",
        "plan": "campaign",
        "put_section": "page",
        "results": "table",
        "section": "table",
    },
)
