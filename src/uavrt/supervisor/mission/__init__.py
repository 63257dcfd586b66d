"""The operator's commands, and which part of them survives a restart.

`orders` decides on commands and knows no processes; `tag_upload`, `kept_parameters` and
`flights` hold tags, settings and flights, `saved_state` what an unclean end must not lose.
`operations` runs jobs that outlast a command; `who_commands` refuses commands of other stations
and `disk_guard` monitors free space.
"""
