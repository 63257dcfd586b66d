"""The companion computer: checks before a flight, start at boot, and updates.

`computer_checks`, `bench` and `autopilot_setup` (with `autopilot_rules`) implement the checks
of `uavrt doctor`. `service` starts uavrt at boot, and `starter` adds it to the desktop menu.
`first_setup` handles the set-up page of the system image. `update`, `update_file`, `versions`
and `trial` install a new version and restore the previous one if the new one fails.
"""
