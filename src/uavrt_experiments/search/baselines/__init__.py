"""Published and simple planners, for comparison."""
