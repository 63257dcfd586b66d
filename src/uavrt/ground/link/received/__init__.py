"""Reports of the drone, stored for the flight's files and for pages."""
