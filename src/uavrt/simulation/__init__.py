"""A world with tags, antennas, a drone, a radio and an autopilot.

Who wants the simulated radio or the recordings imports `uavrt.simulation.source` or
`uavrt.simulation.recording`.
"""

from uavrt.simulation.antenna import Antenna
from uavrt.simulation.demo_scenario import demo_scenario
from uavrt.simulation.flight import Flight, Leg
from uavrt.simulation.propagation import Fading, Propagation, Wall
from uavrt.simulation.scenario import Home, Interferer, Radio, Scenario, SimulatedTag
from uavrt.simulation.scenario_file import (
    load_scenario,
    parse_scenario,
    scenario_toml,
    write_scenario,
)
from uavrt.simulation.synthesis import IQSynthesizer
from uavrt.simulation.world import TruePulse, World

__all__ = [
    "Antenna",
    "Fading",
    "Flight",
    "Home",
    "IQSynthesizer",
    "Interferer",
    "Leg",
    "Propagation",
    "Radio",
    "Scenario",
    "SimulatedTag",
    "TruePulse",
    "Wall",
    "World",
    "demo_scenario",
    "load_scenario",
    "parse_scenario",
    "scenario_toml",
    "write_scenario",
]
