"""Recognise signals that are not the tag's: bursts, other tags' pulses, stronger tags."""
