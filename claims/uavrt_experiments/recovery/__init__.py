"""Kill every process of a flight repeatedly: recovery time, and lost pulses."""
