"""The operator's commands, and the state that survives a restart.

`operator_commands` decides on commands and is independent of processes. `tag_upload`,
`kept_parameters` and `mission_flights` hold tags, settings and flights. `saved_state` stores
what a kill must not lose. `storage/operations` runs long jobs, `commanding_station` refuses
other stations, `storage/disk_guard` monitors space.
"""
