"""Text files of a flight: pulses, poses, output of processes, configurations of detectors."""
