"""The processes of the drone side: thin loops that give stages a socket."""
