"""Determine the antenna's pose at each pulse: interpolated, with the antenna's mounting.

`ring` interpolates between the newest attitudes and positions, which `series` stores;
`attacher` waits for those around a pulse, `mounting` gives the antenna's pose on the vehicle.
"""
