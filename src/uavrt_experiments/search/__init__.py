"""Planners against each other: published tables, paired seeds, bars."""
