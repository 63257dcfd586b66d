"""Estimate positions from bearings and powers, with their 50 % and 95 % radii (`bayes_fix`).

`estimate_position` is the entry point. `bayes_position` is the default; its radii hold a share
of the posterior. `estimate_position` computes the radii for `bearings/lenth`; `regions` makes
outlines.
"""
