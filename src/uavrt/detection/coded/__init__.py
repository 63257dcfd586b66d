"""Detect the bursts of coded tags, many codes of one channel at once.

`slot_cells` computes the energies that all codes share, `sums` adds them at the gaps of each
code. `code_judging` decides whether a sum is a burst, and which tag sent it; `coded_detector`
runs all steps.
"""
