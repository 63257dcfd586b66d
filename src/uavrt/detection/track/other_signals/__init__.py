"""Recognise signals that are not the tag's: bursts, pulses of other tags, stronger tags."""
