"""The thesis's §5.4: message rates through an autopilot."""
