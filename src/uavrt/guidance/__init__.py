"""Move the drone: who is in command, how to fly, at what height; no I/O.

`authority` has the last word on every command and yields to any pilot; `pilot` turns the
operator's orders into wishes; `manners` holds the differences between autopilots. Nothing here
arms a vehicle.
"""
