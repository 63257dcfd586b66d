"""Planners, found by name in `registry`.

`mi_rate` is the default; `ways` and `tangents` give its candidate paths. Published planners are
in `uavrt_experiments.search.baselines`.
"""
