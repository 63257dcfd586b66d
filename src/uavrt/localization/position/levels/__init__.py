"""Compute the likelihood of a position from received power: levels, missed pulses, hills."""
