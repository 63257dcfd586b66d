"""Likelihood of a place from bearings, and whether they agree."""
