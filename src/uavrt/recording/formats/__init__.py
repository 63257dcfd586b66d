"""Logs of other systems and of the original's tools; `read_pulse_log` recognises them all."""
