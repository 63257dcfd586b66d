"""Search for tags in flight: from pulses to decisions and reports."""
