"""Search the time-frequency grid for groups of pulses.

`grid` computes the cells; `noise` and `levelling` estimate the noise in them.
`anchors` and `long_groups` search them for groups of pulses as described in `hypotheses`, with
the limits of `thresholds`. `group_evidence` tests candidates just above the threshold.
"""
