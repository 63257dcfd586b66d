"""Cost of a flight: CPU and memory of each process, and the largest number of tags."""
