"""Compute energies of a channel's slots, and their sums over all pulses of a flight."""
