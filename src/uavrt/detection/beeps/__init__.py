"""Find every sender of regular pulses in a band, whether it is listed or not.

`beep_points` finds strong pulses anywhere in a band. `beep_trains` sorts them by sender, with
intervals from `beats` and `chains`. `naming` compares the resulting trains of pulses with the
listed tags.
"""
