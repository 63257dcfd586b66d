"""The antenna's pose at each pulse: bounded memory, true interpolation, mounting.

`attacher` waits for the poses around a pulse, `series` interpolates, `ring` keeps the newest,
`mounting` turns the autopilot's attitude into the antenna's.
"""
