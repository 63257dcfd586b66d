"""Text files of a flight: pulses, poses, processes, detectors."""
