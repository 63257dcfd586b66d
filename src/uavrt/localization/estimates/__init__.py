"""Estimates from a whole flight or log: turns, bearings, strengths and positions."""
