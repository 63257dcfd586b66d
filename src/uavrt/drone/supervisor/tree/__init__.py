"""Starts, restarts and stops the drone's processes, and kills silent ones (`process_fleet`).

`process_fleet` decides, by the limits of `table`; a `child` only carries it out. `instance` is
a row's process, `process_budgets` its CPU and memory, `process_shapes` the table's variants.
"""
