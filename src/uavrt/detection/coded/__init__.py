"""Detect the bursts of coded tags, many codes of one channel at once.

`cells` computes the energies that all codes share, `sums` adds them at the gaps of each code,
`judging` decides whether a sum is a burst and of which tag, `detector` is the stage.
"""
