"""Estimate bearings from the pulses of a turn in place.

`turns` finds the turns; `estimate_bearing` is the entry point to all estimators: `pattern_ml`
is the default, `classic_bearings` has the published ones, `array_bearings` is for switched
antennas. `learned_pattern`, `two_paths` and `lasting_fading` model real antennas and
propagation.
"""
