"""Commands and parameters on their way to the drone."""
