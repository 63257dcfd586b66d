"""Shows, starts and stops a running system from a terminal on the same computer.

`reader` reads the supervisor's status socket, `operate` sends commands, `view` draws.
"""
