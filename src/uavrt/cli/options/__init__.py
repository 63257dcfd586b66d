"""Options that several commands have, with their limits and checks."""
