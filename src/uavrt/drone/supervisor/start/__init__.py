"""Start processes, and measure their CPU time and memory.

`launcher` starts processes, if possible by a fork of the fork server (`nursery`), which is
faster. `restarts` decides when to restart them, and `usage` measures CPU time and memory.
"""
