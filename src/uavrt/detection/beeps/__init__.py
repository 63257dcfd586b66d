"""Find every sender of regular pulses in a band, listed or not.

`beep_points` finds strong pulses anywhere in a band; `beep_trains` sorts them by sender, with
the intervals of `beats` and `chains`; `naming` compares the trains with the listed tags.
"""
