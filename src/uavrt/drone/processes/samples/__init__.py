"""Parts of receiver and detector: capture, kept channels, watch on the search."""
