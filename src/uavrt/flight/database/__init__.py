"""The SQLite database of a flight."""
