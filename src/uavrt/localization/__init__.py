"""Estimate bearings from pulses, and positions from bearings and signal strengths; the package
does no I/O and reads no clock.

`bearing` and `position` contain the estimators, `antenna` the antenna patterns, `results` the
records of results. `estimates/flight_estimates` applies the estimators to a whole flight. The
`tuning` modules contain the constants.
"""

from typing import TYPE_CHECKING

from uavrt.core.runtime.lazy import lazily

if TYPE_CHECKING:
    from uavrt.localization.antenna import MONOPOLE as MONOPOLE
    from uavrt.localization.antenna import PATTERNS as PATTERNS
    from uavrt.localization.antenna import AntennaPattern as AntennaPattern
    from uavrt.localization.antenna import pattern_named as pattern_named
    from uavrt.localization.bearing.array_bearings import (
        amplitude_monopulse as amplitude_monopulse,
    )
    from uavrt.localization.bearing.array_bearings import switched_bearing as switched_bearing
    from uavrt.localization.bearing.estimate_bearing import BearingData as BearingData
    from uavrt.localization.bearing.estimate_bearing import estimate_bearing as estimate_bearing
    from uavrt.localization.bearing.learned_pattern import TurnPulses as TurnPulses
    from uavrt.localization.bearing.learned_pattern import learn_pattern as learn_pattern
    from uavrt.localization.bearing.switched_pulse import SwitchedPulse as SwitchedPulse
    from uavrt.localization.bearing.switched_pulse import SwitchSchedule as SwitchSchedule
    from uavrt.localization.bearing.switched_pulse import (
        measure_switched_pulse as measure_switched_pulse,
    )
    from uavrt.localization.bearing.turns import Turn as Turn
    from uavrt.localization.bearing.turns import find_turns as find_turns
    from uavrt.localization.position.bearings.stations import Stations as Stations
    from uavrt.localization.position.estimate_position import (
        estimate_position as estimate_position,
    )
    from uavrt.localization.position.levels.level_belief import Listening as Listening
    from uavrt.localization.position.levels.level_evidence import Propagation as Propagation
    from uavrt.localization.position.levels.power_evidence import PowerTrack as PowerTrack
    from uavrt.localization.position.levels.strengths import Strengths as Strengths
    from uavrt.localization.position.levels.strongest import SignalSurface as SignalSurface
    from uavrt.localization.position.levels.strongest import StrongestSignal as StrongestSignal
    from uavrt.localization.position.levels.strongest import signal_surface as signal_surface
    from uavrt.localization.position.levels.strongest import (
        strongest_signal as strongest_signal,
    )
    from uavrt.localization.position.regions import region_outlines as region_outlines
    from uavrt.localization.position.trackers import ParticleTracker as ParticleTracker
    from uavrt.localization.position.trackers import TagPrior as TagPrior
    from uavrt.localization.position.trackers import TrackEstimate as TrackEstimate
    from uavrt.localization.results import ArrayMethod as ArrayMethod
    from uavrt.localization.results import Bearing as Bearing
    from uavrt.localization.results import BearingMethod as BearingMethod
    from uavrt.localization.results import Caution as Caution
    from uavrt.localization.results import Ellipse as Ellipse
    from uavrt.localization.results import Position as Position
    from uavrt.localization.results import PositionGrid as PositionGrid
    from uavrt.localization.results import PositionMethod as PositionMethod
    from uavrt.localization.results import TrackPoint as TrackPoint

__all__, __getattr__ = lazily(
    __name__,
    {
        "uavrt.analysis.integrated.integrated_samples": "integrate",
        "antenna": "AntennaPattern MONOPOLE PATTERNS pattern_named",
        "bearing.array_bearings": "amplitude_monopulse switched_bearing",
        "bearing.estimate_bearing": "BearingData estimate_bearing",
        "bearing.learned_pattern": "TurnPulses learn_pattern",
        "bearing.switched_pulse": "SwitchSchedule SwitchedPulse measure_switched_pulse",
        "bearing.turns": "Turn find_turns",
        "position.estimate_position": "estimate_position",
        "position.levels.level_belief": "Listening",
        "position.levels.level_evidence": "Propagation",
        "position.levels.power_evidence": "PowerTrack",
        "position.regions": "region_outlines",
        "position.bearings.stations": "Stations",
        "position.levels.strengths": "Strengths",
        "position.levels.strongest": "SignalSurface StrongestSignal signal_surface "
        "strongest_signal",
        "position.trackers": "ParticleTracker TagPrior TrackEstimate",
        "results": "ArrayMethod Bearing BearingMethod Caution Ellipse Position PositionGrid "
        "PositionMethod TrackPoint",
    },
)
