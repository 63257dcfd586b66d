"""Compute the likelihood of a position from bearings, and check if they agree."""
