"""Run the whole system, simulated, on one machine.

`run` flies one drone or several, `search` and `search_together` search; `programs` starts the
simulated parts, `watch` and `view` show what happens, `summary` judges it.
"""
