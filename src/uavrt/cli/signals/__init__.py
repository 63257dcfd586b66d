"""Commands for samples, pulses and tag lists."""
