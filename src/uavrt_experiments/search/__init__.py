"""Planners against each other: published tables, paired seeds, bars."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.search.campaign import FOLDERS, fly_all, made_with, plan, so_far
    from uavrt_experiments.search.catalogue import SCENARIOS
    from uavrt_experiments.search.drones import FlightOfDrones
    from uavrt_experiments.search.flight import Outcome
    from uavrt_experiments.search.page import page_section, put_section
    from uavrt_experiments.search.pictures import draw
    from uavrt_experiments.search.processes import (
        PROCESS_FOLDERS,
        PROCESSES,
        RealFlight,
        flights_so_far,
        fly_for_real,
        process_page,
        process_rows,
        process_section,
    )
    from uavrt_experiments.search.table import Flown, honesty, results, section
    from uavrt_experiments.search.terrain import PLANE, Hills, elevation_of

__all__ = [
    "FOLDERS",
    "PLANE",
    "PROCESSES",
    "PROCESS_FOLDERS",
    "SCENARIOS",
    "FlightOfDrones",
    "Flown",
    "Hills",
    "Outcome",
    "RealFlight",
    "draw",
    "elevation_of",
    "flights_so_far",
    "fly_all",
    "fly_for_real",
    "honesty",
    "made_with",
    "page_section",
    "plan",
    "process_page",
    "process_rows",
    "process_section",
    "put_section",
    "results",
    "section",
    "so_far",
]
__getattr__ = lazily(
    __name__,
    {
        "FOLDERS": "campaign",
        "FlightOfDrones": "drones",
        "Flown": "table",
        "Hills": "terrain",
        "Outcome": "flight",
        "PLANE": "terrain",
        "PROCESSES": "processes",
        "PROCESS_FOLDERS": "processes",
        "RealFlight": "processes",
        "SCENARIOS": "catalogue",
        "draw": "pictures",
        "elevation_of": "terrain",
        "flights_so_far": "processes",
        "fly_all": "campaign",
        "fly_for_real": "processes",
        "honesty": "table",
        "made_with": "campaign",
        "page_section": "page",
        "plan": "campaign",
        "process_page": "processes",
        "process_rows": "processes",
        "process_section": "processes",
        "put_section": "page",
        "results": "table",
        "section": "table",
        "so_far": "campaign",
    },
)
