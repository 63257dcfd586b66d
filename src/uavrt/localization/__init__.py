"""From pulses to bearings, from bearings and powers to positions; no I/O, no clocks."""

from uavrt.localization.antenna import PATTERNS, AntennaPattern, monopole_gain_db
from uavrt.localization.array_bearings import (
    amplitude_monopulse,
    circle_steering,
    pair_steering,
    switched_amplitudes,
    switched_bearing,
)
from uavrt.localization.bearing import BearingData, estimate_bearing
from uavrt.localization.learned_pattern import TurnPulses, learn_pattern
from uavrt.localization.level_belief import Listening
from uavrt.localization.level_evidence import Propagation
from uavrt.localization.position import Stations, estimate_position
from uavrt.localization.power_evidence import PowerTrack
from uavrt.localization.records import (
    ArrayMethod,
    Bearing,
    BearingMethod,
    Ellipse,
    Position,
    PositionGrid,
    PositionMethod,
)
from uavrt.localization.regions import region_outlines
from uavrt.localization.strongest import (
    SignalSection,
    SignalSurface,
    StrongestSignal,
    height_bands,
    in_band,
    signal_section,
    signal_surface,
    strongest_signal,
)
from uavrt.localization.switched_pulse import (
    SwitchedPulse,
    SwitchSchedule,
    measure_switched_pulse,
)
from uavrt.localization.trackers import (
    Expectation,
    GridTracker,
    Hypotheses,
    ParticleTracker,
    Spread,
    TagPrior,
    TrackEstimate,
)
from uavrt.localization.turns import Turn, find_turns
from uavrt.tangent_plane import TangentPlane

__all__ = [
    "PATTERNS",
    "AntennaPattern",
    "ArrayMethod",
    "Bearing",
    "BearingData",
    "BearingMethod",
    "Ellipse",
    "Expectation",
    "GridTracker",
    "Hypotheses",
    "Listening",
    "ParticleTracker",
    "Position",
    "PositionGrid",
    "PositionMethod",
    "PowerTrack",
    "Propagation",
    "SignalSection",
    "SignalSurface",
    "Spread",
    "Stations",
    "StrongestSignal",
    "SwitchSchedule",
    "SwitchedPulse",
    "TagPrior",
    "TangentPlane",
    "TrackEstimate",
    "Turn",
    "TurnPulses",
    "amplitude_monopulse",
    "circle_steering",
    "estimate_bearing",
    "estimate_position",
    "find_turns",
    "height_bands",
    "in_band",
    "learn_pattern",
    "measure_switched_pulse",
    "monopole_gain_db",
    "pair_steering",
    "region_outlines",
    "signal_section",
    "signal_surface",
    "strongest_signal",
    "switched_amplitudes",
    "switched_bearing",
]
