"""Start programs, and what is known of a running one.

`launcher` starts a process, by the `nursery` where that is ready; `restarts` says when one may
start again, `usage` what it takes.
"""
