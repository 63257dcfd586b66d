"""A simulated world: tags, antennas, a drone, a radio and an autopilot.

For recordings import `uavrt.simulation.simulated_recording`.
"""
