"""Rehearse every order and every takeover on real autopilots in simulation.

An integrator gives the builds that will fly: PX4 with its SIH physics, ArduCopter's SITL. The
drone's side is the product itself. The pilot who arms, takes off and takes over is part of this
experiment only (`uavrt_experiments.autopilots.hand`).
"""
