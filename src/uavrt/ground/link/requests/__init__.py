"""Send commands and parameters to the drone, and wait for its answers."""
