"""The companion computer: checks before a flight, start at boot, updates.

`computer_checks`, `bench` and `autopilot_setup` (with `autopilot_rules`) are the checks of
`uavrt doctor`. `service` and `starter` start uavrt at boot or from a menu, `first_setup` is an
image's set-up page. `update`, `update_file`, `versions` and `trial` exchange versions.
"""
