"""What the drone reported, kept for the flight's files and for pages."""
