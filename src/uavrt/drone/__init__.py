"""The drone's programs: which processes run, what they do, and the computer under them.

`supervisor` starts the processes of `processes` and connects them by `ipc`; `computer` checks,
installs and updates, `status_reader` reads the supervisor's socket, `card` examines storage.
"""
