"""Delivery of pulses over a link that loses messages."""
