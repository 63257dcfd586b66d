"""Models of drones: actions, motion, energy, and the paths of other drones."""
