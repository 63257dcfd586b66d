"""The process tree: which processes run, and how they are started, monitored and stopped.

`table` lists the processes of the drone side and `shapes` its variants. `fleet` holds an
`instance` per row, each with a `child`. `budget` monitors them; `waiting_records` and
`child_records` carry their records.
"""
