"""Detect the bursts of coded tags; all codes of a channel are searched together.

`slot_cells` computes pulse energies, which all codes share. `sums` adds the energies at the
gaps of each code. `code_judging` decides whether a sum is a burst, and which tag sent it.
`coded_detector` runs all steps.
"""
