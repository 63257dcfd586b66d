"""Where the antenna was, and how it pointed, at the instant of a pulse."""
