"""Starts and measures processes.

`launcher` starts them, by a fork of the `nursery` where possible. `restarts` decides on
restarts and `usage` measures CPU and memory.
"""
