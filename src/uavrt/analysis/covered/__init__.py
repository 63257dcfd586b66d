"""Map where a tag would be detected, along planned and flown paths."""
