"""Estimate turns, bearings, signal strengths and positions from a whole flight or log."""
