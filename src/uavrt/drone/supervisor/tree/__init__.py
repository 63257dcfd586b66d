"""Start, restart and stop the drone's processes, and kill those that hang.

`process_tree` decides by the limits in `table`. A `child` is one running process. An `instance`
keeps its state over restarts. `process_budgets` checks its CPU time and memory, and
`process_shapes` has variants of the table.
"""
