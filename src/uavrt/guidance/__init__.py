"""Move the drone: who is in command, how to fly, at what height; no I/O.

`control/authority` checks every command last and yields to any pilot; `pilot` flies the
operator's orders step by step; `autopilot_behaviour` has the differences between autopilots.
Nothing here arms a vehicle.
"""
