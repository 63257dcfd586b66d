"""Starts, monitors, restarts and stops the processes of the drone.

`table` lists the processes and `process_shapes` its variants. `process_fleet` holds an
`instance` for each row, each with a `child`. `process_budgets` monitors their use of CPU and
memory; `waiting_records` and `child_records` carry their records.
"""
