"""Compute the energies of a channel's time slots, and sum them over all pulses of a flight."""
