"""Run the whole system, simulated, on one machine."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.demo.programs import DemoPaths, Program, drone_settings, free_udp_port
    from uavrt.demo.rig import Rig, SimulatedDrone, starting_in
    from uavrt.demo.run import Demo
    from uavrt.demo.search import SearchSummary, SoughtAnimal, run_search_demo
    from uavrt.demo.search_together import TogetherSummary, run_together_demo
    from uavrt.demo.summary import DemoSummary
    from uavrt.demo.worlds import flight_world, search_world

__all__ = [
    "Demo",
    "DemoPaths",
    "DemoSummary",
    "Program",
    "Rig",
    "SearchSummary",
    "SimulatedDrone",
    "SoughtAnimal",
    "TogetherSummary",
    "drone_settings",
    "flight_world",
    "free_udp_port",
    "run_search_demo",
    "run_together_demo",
    "search_world",
    "starting_in",
]
__getattr__ = lazily(
    __name__,
    {
        "Demo": "run",
        "DemoPaths": "programs",
        "DemoSummary": "summary",
        "Program": "programs",
        "Rig": "rig",
        "SimulatedDrone": "rig",
        "starting_in": "rig",
        "SearchSummary": "search",
        "SoughtAnimal": "search",
        "TogetherSummary": "search_together",
        "run_together_demo": "search_together",
        "drone_settings": "programs",
        "free_udp_port": "programs",
        "run_search_demo": "search",
        "flight_world": "worlds",
        "search_world": "worlds",
    },
)
