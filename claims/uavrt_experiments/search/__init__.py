"""Comparison of planners in published scenarios, with paired seeds and requirements."""
