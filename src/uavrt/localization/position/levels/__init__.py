"""Compute the likelihood of a position from received power, including missed pulses and losses
behind hills.
"""
