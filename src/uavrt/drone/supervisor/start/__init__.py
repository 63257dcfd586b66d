"""Start processes, and measure their CPU time and memory.

`launcher` starts processes, by a fork of the `nursery` where possible. `restarts` decides on
restarts and `usage` measures CPU and memory.
"""
