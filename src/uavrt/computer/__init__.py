"""The companion computer: checks before a flight, start at boot, updates.

`checks` and `bench` are `uavrt doctor`'s, `autopilot_setup` examines the autopilot's parameters
by `autopilot_rules`. `service` and `starter` start at boot, `first_setup` is an image's first
page; `update`, `update_file`, `versions` and `trial` exchange versions.
"""
