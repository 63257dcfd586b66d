"""Finding a tag's pulses in the samples of a channel."""
