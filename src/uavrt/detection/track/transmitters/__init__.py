"""Which transmitter sent a train of pulses: a listed tag, another, or a ghost."""
