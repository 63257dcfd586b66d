"""The simulated world: tags, antennas, paths, propagation, scenario files."""
