"""Modules that all packages share: records, commands, units, errors, clock, geodesy.

`messages` defines the records that processes exchange, and `commands` the table of commands.
Only `clock` reads the time, and only `log` writes log lines.
"""
