"""Bearings and positions of flights and logs, and their plain records."""
