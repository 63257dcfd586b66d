"""Rehearse every order and every takeover on real autopilots in simulation.

An integrator gives the builds that will fly: PX4 with its SIH physics, ArduCopter's SITL. The
drone's side is the product itself; the pilot who arms, takes off and takes over is a client of
this experiment alone (`uavrt_experiments.autopilots.hand`).
"""
