"""Comparison of planners: published tables, paired seeds, bars."""
