"""Detect the bursts of coded tags, many codes of one channel at once.

`cells` makes the energies that all codes share, `sums` adds them up at the gaps of each code,
`judging` says whether a sum is a burst and whose, `detector` is the stage.
"""
