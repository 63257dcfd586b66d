"""Which processes run, when, and what happens when one dies."""
