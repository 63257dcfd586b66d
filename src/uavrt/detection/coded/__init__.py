"""Detect the bursts of coded tags; all codes of a channel are searched together.

`slot_cells` computes pulse energies, `sums` adds them at the gaps of each code, and
`code_judging` decides which sums are bursts of which tag. `coded_detector` runs all steps.
"""
