"""Read data about flights that estimates and reports need: settings, noise, clocks, maps."""
