"""Run the whole system, simulated, on one machine.

`run` is one drone, `fleet` several, `search` and `search_together` searches; `programs` starts
the simulated parts, `watch` and `view` show what happens, `summary` judges it.
"""
