"""Whole-flight results as pulses, pictures and records, and the process that computes them in
flight.
"""
