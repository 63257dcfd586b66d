"""Whole-flight results as pulses, pictures and records; the process that computes them."""
