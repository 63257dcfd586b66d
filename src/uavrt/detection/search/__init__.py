"""Search the time-frequency grid for groups of pulses.

`grid` and `spectra` compute the cells; `noise` and `levelling` estimate the noise in them.
`anchors` and `long_groups` search them as `hypotheses` describes, against `thresholds`;
`group_evidence` tests candidates just above the threshold.
"""
