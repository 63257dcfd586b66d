"""Simulate a vehicle: its motion, autopilot, telemetry and radio links."""
