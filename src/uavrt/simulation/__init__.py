"""A world with tags, antennas, a drone, a radio and an autopilot."""
