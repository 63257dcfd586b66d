"""Messages to the ground: rate, route, signature and texts."""
