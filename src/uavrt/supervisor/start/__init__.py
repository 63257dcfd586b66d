"""Starts and measures programs.

`launcher` starts a process, by the `nursery` if ready; `restarts` decides on restarts, `usage`
measures.
"""
