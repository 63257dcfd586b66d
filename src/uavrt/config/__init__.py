"""What the user writes: ``uavrt.toml`` and tag files, read with all their faults at once."""
