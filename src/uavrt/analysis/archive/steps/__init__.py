"""Steps of a batch: detection by cell, estimates by flight, parallel tasks."""
