"""Times of a live stream's samples, and samples that were lost."""
