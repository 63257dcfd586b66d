"""Flights and pulse logs, read back: complete, damaged or of another system."""
