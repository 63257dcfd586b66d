"""A simulated world: tags, antennas, a drone, a radio and an autopilot.

For the simulated radio import `uavrt.simulation.source`; for recordings,
`uavrt.simulation.recording`.
"""
