"""Estimate turns, bearings, strengths and positions from a whole flight or log."""
