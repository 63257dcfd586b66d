"""Parts of the connection that send motion commands and report the vehicle's state."""
