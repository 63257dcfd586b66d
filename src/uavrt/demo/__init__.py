"""Run the whole system, simulated, on one machine."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.demo.fleet import run_fleet_demo
    from uavrt.demo.programs import DemoPaths, Program, drone_settings, free_udp_port
    from uavrt.demo.run import run_demo
    from uavrt.demo.search import SearchSummary, SoughtAnimal, run_search_demo
    from uavrt.demo.search_together import TogetherSummary, run_together_demo
    from uavrt.demo.summary import DemoSummary
    from uavrt.demo.worlds import flight_world, search_world

__all__ = [
    "DemoPaths",
    "DemoSummary",
    "Program",
    "SearchSummary",
    "SoughtAnimal",
    "TogetherSummary",
    "drone_settings",
    "flight_world",
    "free_udp_port",
    "run_demo",
    "run_fleet_demo",
    "run_search_demo",
    "run_together_demo",
    "search_world",
]
__getattr__ = lazily(
    __name__,
    {
        "DemoPaths": "programs",
        "DemoSummary": "summary",
        "Program": "programs",
        "SearchSummary": "search",
        "SoughtAnimal": "search",
        "TogetherSummary": "search_together",
        "run_together_demo": "search_together",
        "drone_settings": "programs",
        "free_udp_port": "programs",
        "run_demo": "run",
        "run_fleet_demo": "fleet",
        "run_search_demo": "search",
        "flight_world": "worlds",
        "search_world": "worlds",
    },
)
