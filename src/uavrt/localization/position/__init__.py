"""Estimate positions from bearings and signal powers, with their 50 % and 95 % radii.

`estimate_position` calls any of the estimators. `bayes_position` is the default; its radii
contain 50 % and 95 % of the posterior, which `bayes_fix` computes. For estimates by
`bearings/lenth`, `estimate_position` computes the radii. `regions` computes outlines for
maps.
"""
