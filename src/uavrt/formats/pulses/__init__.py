"""Pulse logs of other systems, each read into one record (`pulse_log`)."""
