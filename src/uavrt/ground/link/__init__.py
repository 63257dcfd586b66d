"""The ground's side of the link to a drone.

`protocol` and `delivery_receipts` hold the protocol, without I/O; `drone_link` runs it over
MAVLink and `parallel_links` over several links at once. `commands` sends one command at a time,
`vehicle` listens to the autopilot, `vehicle_identity` and `keys` decide whom to trust;
`my_place` is this computer's own GPS receiver, `motion` and `flying` ask for motions,
`given_ways` keeps drones that search together apart.
"""
