"""Find every sender of regular pulses in a band, listed or not.

`points` finds strong pulses anywhere in a band; `trains` sorts them by sender, with the
intervals of `beats` and `chains`; `naming` compares the trains with the listed tags.
"""
