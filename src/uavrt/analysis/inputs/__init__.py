"""Read what estimates and reports need to know about flights: settings, noise, clocks, maps."""
