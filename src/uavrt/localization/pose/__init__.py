"""Determine the antenna's pose at each pulse by interpolation and the antenna's mounting.

`ring` interpolates between the latest attitudes and positions, which `series` stores.
`attacher` waits for the poses around a pulse, and `mounting` converts the vehicle's pose to the
antenna's.
"""
