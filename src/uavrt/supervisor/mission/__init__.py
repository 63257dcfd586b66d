"""What the operator asked for, and which part of it survives a restart.

`orders` holds state, tags and flight, and knows no processes. `saved_state` and
`kept_parameters` are its files; `operations` runs jobs that outlast a command;
`who_commands` refuses strangers' commands and `disk_guard` watches free space.
"""
