"""Model of the drones: actions, motion, energy, and paths of other drones."""
