"""Find everything that beeps, without knowing any tag.

`points` finds strong pulses anywhere in a band; `trains` sorts them by sender, with the
intervals of `beats` and `chains`; `naming` compares the trains with the listed tags.
"""
