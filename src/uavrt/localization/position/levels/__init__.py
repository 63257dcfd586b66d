"""Likelihood of a place from received power: levels, missed pulses, hills."""
