"""Messages from and to the autopilot: pose, state, missions, parameters, time."""
