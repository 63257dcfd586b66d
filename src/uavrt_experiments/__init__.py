"""Claims as repeatable experiments."""
