"""From pulses to bearings, from bearings and powers to positions; no I/O, no clocks."""
