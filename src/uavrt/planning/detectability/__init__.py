"""Probability of detecting a tag at a position, from link budget, propagation and antenna
path.
"""
