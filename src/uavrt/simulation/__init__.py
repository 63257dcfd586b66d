"""A simulated world: tags, antennas, a drone, a radio and an autopilot.

For the simulated radio import `uavrt.simulation.source`; for recordings,
`uavrt.simulation.recording`.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.simulation.antenna import Antenna
    from uavrt.simulation.antenna_switch import AntennaSwitch, gate, position_weights
    from uavrt.simulation.arrivals import DeliveredStream, Delivery
    from uavrt.simulation.demo_world import (
        demo_scenario,
        fleet_scenarios,
        search_scenario,
        searched_scenario,
    )
    from uavrt.simulation.flight import Flight, Leg
    from uavrt.simulation.flown_path import FlownPath
    from uavrt.simulation.forwarding import PASS_NS, ForwardRing
    from uavrt.simulation.geometry import from_euler_deg
    from uavrt.simulation.link_trial import LinkTrial, TrialSettings
    from uavrt.simulation.propagation import Fading, Propagation, Wall, ground_reflection
    from uavrt.simulation.radio_link import RadioLinkSettings
    from uavrt.simulation.recording import simulate_to_directory
    from uavrt.simulation.relief import Relief
    from uavrt.simulation.scenario import Home, Interferer, Radio, Scenario, SimulatedTag
    from uavrt.simulation.scenario_file import (
        load_scenario,
        parse_scenario,
        scenario_toml,
        write_scenario,
    )
    from uavrt.simulation.source import SimulatedSource
    from uavrt.simulation.steady_radio import steady_tags
    from uavrt.simulation.synthesis import IQSynthesizer, SampleFormat
    from uavrt.simulation.telemetry import telemetry_message
    from uavrt.simulation.world import TruePulse, World

__all__ = [
    "PASS_NS",
    "Antenna",
    "AntennaSwitch",
    "DeliveredStream",
    "Delivery",
    "Fading",
    "Flight",
    "FlownPath",
    "ForwardRing",
    "Home",
    "IQSynthesizer",
    "Interferer",
    "Leg",
    "LinkTrial",
    "Propagation",
    "Radio",
    "RadioLinkSettings",
    "Relief",
    "SampleFormat",
    "Scenario",
    "SimulatedSource",
    "SimulatedTag",
    "TrialSettings",
    "TruePulse",
    "Wall",
    "World",
    "demo_scenario",
    "fleet_scenarios",
    "from_euler_deg",
    "gate",
    "ground_reflection",
    "load_scenario",
    "parse_scenario",
    "position_weights",
    "scenario_toml",
    "search_scenario",
    "searched_scenario",
    "simulate_to_directory",
    "steady_tags",
    "telemetry_message",
    "write_scenario",
]
__getattr__ = lazily(
    __name__,
    {
        "Antenna": "antenna",
        "AntennaSwitch": "antenna_switch",
        "DeliveredStream": "arrivals",
        "Delivery": "arrivals",
        "Fading": "propagation",
        "Flight": "flight",
        "FlownPath": "flown_path",
        "ForwardRing": "forwarding",
        "Home": "scenario",
        "IQSynthesizer": "synthesis",
        "Interferer": "scenario",
        "Leg": "flight",
        "LinkTrial": "link_trial",
        "PASS_NS": "forwarding",
        "Propagation": "propagation",
        "Radio": "scenario",
        "RadioLinkSettings": "radio_link",
        "Relief": "relief",
        "SampleFormat": "synthesis",
        "Scenario": "scenario",
        "SimulatedSource": "source",
        "SimulatedTag": "scenario",
        "TrialSettings": "link_trial",
        "TruePulse": "world",
        "Wall": "propagation",
        "World": "world",
        "demo_scenario": "demo_world",
        "fleet_scenarios": "demo_world",
        "from_euler_deg": "geometry",
        "gate": "antenna_switch",
        "ground_reflection": "propagation",
        "load_scenario": "scenario_file",
        "parse_scenario": "scenario_file",
        "position_weights": "antenna_switch",
        "scenario_toml": "scenario_file",
        "search_scenario": "demo_world",
        "searched_scenario": "demo_world",
        "simulate_to_directory": "recording",
        "steady_tags": "steady_radio",
        "telemetry_message": "telemetry",
        "write_scenario": "scenario_file",
    },
)
