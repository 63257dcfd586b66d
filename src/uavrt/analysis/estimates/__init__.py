"""Estimate bearings and positions from flights and logs, and convert them to plain records."""
