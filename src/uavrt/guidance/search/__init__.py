"""A search in flight: pulses in, decisions and reports out."""
