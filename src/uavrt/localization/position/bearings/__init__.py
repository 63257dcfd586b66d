"""Compute the likelihood of a position from bearings, and check whether the bearings agree."""
