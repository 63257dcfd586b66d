"""Measured performance of the evaluation of whole flights: false alarms, range, place, cost."""
