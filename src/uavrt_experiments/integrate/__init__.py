"""Measured performance of judging whole flights: false alarms, range, place, cost."""
