"""Parts of the connection that move the vehicle and report it."""
