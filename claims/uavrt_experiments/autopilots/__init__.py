"""Rehearse every order and every takeover on real autopilots in simulation.

The builds are those that will fly: PX4 with its SIH physics, and ArduCopter's SITL. The drone
side runs uavrt's own programs. The pilot who arms, takes off and takes over is part of this
experiment only (`uavrt_experiments.autopilots.hand`).
"""
