"""The supervisor: starts the drone's processes, restarts those that end, carries out commands.

`supervisor_program` is the entry point. `start` starts programs, `tree` keeps the processes of
the table running, and `mission` carries out the operator's commands.
"""
