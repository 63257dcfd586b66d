"""The thesis's rotation test (§5.5) repeated: the origin of its 50°."""
