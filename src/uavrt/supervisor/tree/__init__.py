"""Starts, monitors, restarts and stops the processes of the drone.

`table` lists the processes and `shapes` its variants. `fleet` holds an `instance` for each row,
each with a `child`. `budget` monitors their use of CPU and memory; `waiting_records` and
`child_records` carry their records.
"""
