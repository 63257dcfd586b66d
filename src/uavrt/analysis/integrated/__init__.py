"""Whole-flight results as pulses, pictures and records, and their process in flight."""
