"""Planners that were published, and simple ones, to compare ours with."""
