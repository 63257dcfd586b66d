"""Positions from bearings and powers.

`estimate_position` is the entry point to all estimators: `bayes_fix` is the default, `lenth`
has those of the literature. `bearing_evidence` and `power_evidence` compute likelihoods,
`common_errors` finds errors that bearings share, `trackers` follow a tag in flight, `regions`
outlines it.
"""
