"""Motions of the drone as the operator requests them."""
