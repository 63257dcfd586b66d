"""Published and simple planners, with which ours is compared."""
