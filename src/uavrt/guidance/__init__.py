"""Move the drone: who commands it, how orders are flown, at what height; no I/O.

`control/authority` is the last check of every command and yields to any pilot.
`order_execution` flies the operator's orders step by step; `autopilot_behaviour` lists the
differences between autopilots. Nothing here arms a vehicle.
"""
