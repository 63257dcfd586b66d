"""A simulated world: tags, antennas, a drone, a radio and an autopilot.

To write simulated recordings, import `uavrt.simulation.simulated_recording`.
"""
