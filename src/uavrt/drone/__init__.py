"""The drone's programs: its processes, and the checks and updates of its computer.

`supervisor` starts the processes of `processes` and connects them by `ipc`; `computer` checks,
installs and updates, `status_reader` reads the supervisor's socket, `card` examines storage.
"""
