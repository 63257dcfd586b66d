"""Runs the whole system with a simulated world on one computer.

`run` flies one drone or several, `search` and `search_together` search; `programs` starts the
programs, `watch` and `view` show what happens, `summary` evaluates it.
"""
