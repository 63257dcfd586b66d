"""Identify the transmitter of a train of pulses: a listed tag, another, or a ghost."""
