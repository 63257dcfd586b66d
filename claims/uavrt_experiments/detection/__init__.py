"""Measured performance of the detector: signals, trials, and the tables of the claims."""
