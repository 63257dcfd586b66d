"""Shared by all packages: records, commands, units, errors, clock, geodesy.

`messages` are the records between processes, `commands` the table of commands. `clock` and
`log` are the only ones that read time or write logs.
"""
