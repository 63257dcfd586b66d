"""Motions of the drone that the operator requests from the ground."""
