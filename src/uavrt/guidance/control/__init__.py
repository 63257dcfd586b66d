"""Who commands the vehicle, what was commanded, and what the vehicle does."""
