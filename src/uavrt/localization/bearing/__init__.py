"""Estimate bearings from the pulses received during a turn in place.

`turns` finds the turns; `estimate_bearing` calls any of the estimators. `pattern_ml` is the
default, `classic_bearings` contains published methods, and `array_bearings` is for switched
antennas. `learned_pattern`, `two_paths` and `lasting_fading` model real antennas and
propagation.
"""
