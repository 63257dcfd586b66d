"""Parts of the connection: ground stations, poses, pulses, parameters, status."""
