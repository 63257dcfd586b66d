"""Search for tags in flight: evaluate pulses, decide where to fly, and report."""
