"""Read pulse logs of other systems; each reader returns a `PulseLog`."""
