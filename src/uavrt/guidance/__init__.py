"""Move the drone: who may command it, how orders are flown, at what height.

Nothing here does I/O or arms a vehicle.

`control/authority` is the last check of every command and yields to any pilot.
`order_execution` flies the operator's orders step by step. `autopilot_behaviour` lists the
differences between autopilots.
"""
