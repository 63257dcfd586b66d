"""Planners, found by name in `registry`.

`mi_rate` is ours; `approach`, `joint`, `published`, `surveys` and `tangents` are from
publications.
"""
