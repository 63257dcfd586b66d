"""Planners that choose where to fly next, found by name in `registry`.

`mi_rate` is the default; `ways` generates its candidate paths. Planners from the
literature are in `uavrt_experiments.search.baselines`.
"""
