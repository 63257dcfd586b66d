"""Probability of detecting a tag from link budget, propagation and antenna path."""
