"""What a flight costs: CPU and memory of each process, and how many tags are too many."""
