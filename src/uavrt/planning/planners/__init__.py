"""Planners, found by name in `registry`.

`mi_rate` is ours; `ways` and `tangents` give its candidate paths. The published ones are in
`uavrt_experiments.search.baselines`.
"""
