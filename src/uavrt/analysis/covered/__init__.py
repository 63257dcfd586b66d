"""Where a tag would have been detected, before and after a flight."""
