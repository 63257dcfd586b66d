"""Commands that predict where a tag is detected."""
