"""Probability of detecting a tag at a place: link budget, propagation, coverage."""
