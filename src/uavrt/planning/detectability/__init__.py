"""Probability of detecting a tag at a position: link budget, propagation, coverage."""
