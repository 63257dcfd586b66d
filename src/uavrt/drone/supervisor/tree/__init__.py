"""Start, restart and stop the drone's processes, and kill silent ones (`process_tree`).

`process_tree` decides, by the limits of `table`; a `child` is one running process. `instance`
is a row's process, `process_budgets` its CPU and memory, `process_shapes` the table's variants.
"""
