"""The operator's commands, and which part of them survives a restart.

`orders` holds state, tags and flight, and knows no processes. `saved_state` and
`kept_parameters` are its files; `operations` runs jobs that outlast a command; `who_commands`
refuses commands of other stations and `disk_guard` monitors free space.
"""
