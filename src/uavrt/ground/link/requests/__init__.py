"""Sending commands and parameters to the drone, and waiting for the answers."""
