"""Commands that run the system, simulate it, or control it."""
