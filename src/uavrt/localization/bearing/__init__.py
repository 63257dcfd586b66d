"""From a turn's pulses to a bearing.

`turns` finds the turns; `estimate` is the entry point to all estimators: `pattern_ml` is the
default, `classic_bearings` has the published ones, `array_bearings` is for switched antennas.
`learned_pattern`, `two_paths` and `lasting_fading` model real antennas and propagation.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.localization.bearing.array_bearings import Steering, switched_bound_deg
    from uavrt.localization.bearing.estimate import ADDED_METHODS, estimate_bearing
    from uavrt.localization.bearing.learned_pattern import TurnPulses, learn_pattern
    from uavrt.localization.bearing.live_bearings import LiveBearings
    from uavrt.localization.bearing.posterior import LOBE_DEG
    from uavrt.localization.bearing.turns import CLIMB_M, Turn, find_turns

__all__ = [
    "ADDED_METHODS",
    "CLIMB_M",
    "LOBE_DEG",
    "LiveBearings",
    "Steering",
    "Turn",
    "TurnPulses",
    "estimate_bearing",
    "find_turns",
    "learn_pattern",
    "switched_bound_deg",
]
__getattr__ = lazily(
    __name__,
    {
        "ADDED_METHODS": "estimate",
        "CLIMB_M": "turns",
        "LOBE_DEG": "posterior",
        "LiveBearings": "live_bearings",
        "Steering": "array_bearings",
        "Turn": "turns",
        "TurnPulses": "learned_pattern",
        "estimate_bearing": "estimate",
        "find_turns": "turns",
        "learn_pattern": "learned_pattern",
        "switched_bound_deg": "array_bearings",
    },
)
