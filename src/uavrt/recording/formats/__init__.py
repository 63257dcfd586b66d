"""Logs of other systems and of the original's tools, one module per format.

`read_pulses` and `read_pulse_log` recognise them all.
"""
