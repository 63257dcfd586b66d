"""The simulated vehicle: motion, autopilot, telemetry and its links."""
